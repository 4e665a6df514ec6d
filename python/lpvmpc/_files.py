"""Texts on their way into files, and out of them."""

from __future__ import annotations

import os
import shutil
from os import PathLike
from pathlib import Path

from . import _lpvmpc


def read(path: str | PathLike[str]) -> str:
    """The text of a file; an ``OSError`` with its name if it cannot be read, is none in UTF-8, or is longer than any that
    is needed, as a device that never ends is."""
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read(_lpvmpc.MOST_BYTES + 1)
    except UnicodeDecodeError:
        raise OSError(f"{os.fspath(path)}: it is not text in UTF-8") from None
    if len(text) > _lpvmpc.MOST_BYTES:
        raise OSError(f"{os.fspath(path)}: it has more than 64 MiB, which no file of this kind needs")
    return text


def save(text: str, path: str | PathLike[str], overwrite: bool) -> None:
    """Writes a text, the whole of it or nothing; an error if the file is there and is not to be overwritten."""
    place = Path(os.path.realpath(path))
    if place.exists() and not place.is_file():  # a pipe, a device
        place.write_text(text, encoding="utf-8")
        return
    is_new = not place.exists()
    if not overwrite:
        place.open("x").close()
    beside = place.with_name(f".{place.name}.{os.getpid()}.part")
    try:
        beside.write_text(text, encoding="utf-8")
        if not is_new:
            shutil.copymode(place, beside)
        beside.replace(place)
    except BaseException:
        beside.unlink(missing_ok=True)
        if is_new and not overwrite:
            place.unlink(missing_ok=True)
        raise
