"""Values and texts on their way into files and back."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MissingPackageError


def plain(value: Any) -> Any:
    """What the native half takes for a value of TOML: arrays as lists, paths as texts."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, PathLike):
        return fspath(value)
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    return value


def save(text: str, path: str | PathLike[str], overwrite: bool) -> None:
    """Writes a text; an error if the file is there and is not to be overwritten."""
    with Path(path).open("w" if overwrite else "x", encoding="utf-8") as file:
        file.write(text)


def pandas() -> Any:
    """The package pandas."""
    try:
        import pandas
    except ImportError as error:
        raise MissingPackageError(
            "this needs pandas: pip install pandas, or pip install lpvmpc[pandas]"
        ) from error
    return pandas
