"""Texts on their way into files."""

from __future__ import annotations

from os import PathLike
from pathlib import Path


def save(text: str, path: str | PathLike[str], overwrite: bool) -> None:
    """Writes a text; an error if the file is there and is not to be overwritten."""
    with Path(path).open("w" if overwrite else "x", encoding="utf-8") as file:
        file.write(text)
