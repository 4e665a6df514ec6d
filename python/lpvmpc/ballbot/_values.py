"""Values on their way to the native half, and tables of results."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike, fspath
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


def pandas() -> Any:
    """The package pandas."""
    try:
        import pandas
    except ImportError as error:
        raise MissingPackageError(
            "this needs pandas: pip install pandas, or pip install lpvmpc[pandas]"
        ) from error
    return pandas
