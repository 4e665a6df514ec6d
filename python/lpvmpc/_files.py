"""Texts on their way into files."""

from __future__ import annotations

import os
import shutil
from os import PathLike
from pathlib import Path


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
