"""Campaigns: a scenario run many times, with what varies in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _lpvmpc
from .._files import read
from .._progress import reported
from ..errors import ScenarioError, SettingError
from ._values import pandas, plain


@dataclass(frozen=True, repr=False, eq=False)
class CampaignResult:
    """What the runs of a campaign gave."""

    summary: dict[str, Any]
    """What they say together: as ``summary.json`` of ``ballbot campaign``. Of a rare failure its ``probability`` with
    an interval, and the ``levels`` on the way to it."""
    columns: dict[str, NDArray[Any]]
    """A column by its name, as in ``runs.csv``: number of the run, seed, outcome, success, inputs and measures. Numbers
    are NaN where there are none; ``success`` is None of a run that makes no scenario. Of a rare failure the points
    that lead to it: seed and inputs."""

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A column by its name."""
        if name not in self.columns:
            raise KeyError(f"{name!r}: there are {', '.join(self.columns)}")
        return self.columns[name]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def to_dataframe(self) -> Any:
        """The columns as a pandas ``DataFrame``.

        Raises
        ------
        MissingPackageError
            pandas is not installed.
        """
        return pandas().DataFrame(self.columns)

    def __repr__(self) -> str:
        return f"<CampaignResult {self.summary['title']!r}: {len(self)} rows>"


def campaign(
    campaign: str | PathLike[str] | Mapping[str, Any],
    *,
    folder: str | PathLike[str] = ".",
    threads: int = 0,
    progress: bool = False,
) -> CampaignResult:
    """Runs a campaign of your own: as ``ballbot campaign FILE``, with the same numbers, on any number of threads.

    Parameters
    ----------
    campaign
        The path of its TOML file; or its keys and values. ``docs/campaigns.md`` has them all, `campaign_example` is
        one with comments.
    folder
        Where the scenario is looked for that keys and values name; a file's is beside it.
    threads
        Threads; 0 for one per core.
    progress
        Whether to show a progress bar (needs tqdm).

    Raises
    ------
    OSError
        The file cannot be read, or is no text.
    ScenarioError
        It is no campaign; the message names the place and what would be right. Or a run draws what makes no scenario.

    Examples
    --------
    >>> from lpvmpc import ballbot
    >>> found = ballbot.campaign({
    ...     "title": "Torque", "scenario": "two-setpoints", "runs": 8, "measure": ["largest_tilt_rad"],
    ...     "vary": [{"key": "bounds.torque_nm.1", "uniform": [0.9, 1.5]}]})
    >>> found.summary["runs"], found["outcome"].tolist().count("complete")
    (8, 8)
    """
    if isinstance(campaign, Mapping):
        content, path = plain(campaign), Path(folder) / "the campaign"
    else:
        path = Path(campaign)
        content = read(path)
    if not 0 <= threads <= 1024:
        raise SettingError(f"threads: it is {threads}; it must be from 0 to 1024")
    with reported(progress) as report, TemporaryDirectory(prefix="lpvmpc-") as temporary:
        rows = Path(temporary) / "runs.parquet"
        summary, columns = _lpvmpc.run_campaign(content, path, threads, rows, report)
    if "refused" in summary and summary["refused"] == summary["runs"]:
        raise ScenarioError('all runs were refused by the scenario: `refused = "stop"` says why')
    return CampaignResult(summary, {name: np.array(column) for name, column in columns.items()})


def campaign_example() -> str:
    """The text of a campaign's file with comments, to be changed."""
    return _lpvmpc.campaign_example()
