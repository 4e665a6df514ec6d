"""Progress of long computations."""

from __future__ import annotations

from collections.abc import Iterable

from .errors import MissingPackageError


def samples_of(count: int, shown: bool) -> Iterable[int]:
    """0 to count - 1, with a bar if it is to be shown."""
    if not shown:
        return range(count)
    try:
        from tqdm.auto import tqdm
    except ImportError as error:
        raise MissingPackageError(
            "a progress bar needs tqdm: pip install tqdm, or pip install lpvmpc[progress]"
        ) from error
    bar: Iterable[int] = tqdm(range(count), unit="sample")
    return bar
