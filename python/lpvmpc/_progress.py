"""Progress of long computations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Optional

from .errors import MissingPackageError

Report = Optional[Callable[[str, int, int], None]]
"""Is told the name of the work, the steps that are done, and all of them."""


def samples_of(count: int, shown: bool) -> Iterable[int]:
    """0 to count - 1, with a bar if it is to be shown."""
    if not shown:
        return range(count)
    bar: Iterable[int] = _tqdm()(range(count), unit="sample")
    return bar


@contextmanager
def reported(shown: bool) -> Iterator[Report]:
    """What a long computation tells its progress, if it is to be shown: a bar for each work, one after the other."""
    if not shown:
        yield None
        return
    tqdm = _tqdm()
    bar: Any = None
    shown_work = ""

    def report(what: str, done: int, steps: int) -> None:
        nonlocal bar, shown_work
        if what != shown_work:
            if bar is not None:
                bar.close()
            bar, shown_work = tqdm(desc=what, total=steps), what
        # Of how many steps it will be is known about only, of some work.
        bar.update(min(done, steps) - bar.n)

    try:
        yield report
    finally:
        if bar is not None:
            bar.close()


def _tqdm() -> Any:
    try:
        from tqdm.auto import tqdm
    except ImportError as error:
        raise MissingPackageError(
            "a progress bar needs tqdm: pip install tqdm, or pip install lpvmpc[progress]"
        ) from error
    return tqdm
