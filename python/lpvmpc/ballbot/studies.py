"""Studies: what is guaranteed, counted; times of a step; the paper's numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from .. import _lpvmpc
from .._arrays import instance, listed, whole
from .._progress import reported
from ._values import pandas
from .scenario import Scenario


@dataclass(frozen=True)
class Bench:
    """Times of controllers' steps on this machine, microseconds: median, 99th percentile and longest."""

    sequences: list[dict[str, Any]]
    """Of each scenario the quadratic program alone (``qp_us``), the whole step (``step_us``), and both when other work
    was in the cache (``qp_cold_us``, ``step_cold_us``); of a sequence of problems the step is the program alone."""
    guaranteed: dict[str, dict[str, float]]
    """The guaranteed step of ``far-setpoints`` beside plain ones."""

    def to_dataframe(self) -> Any:
        """A pandas ``DataFrame`` with a row for each scenario and columns such as ``step_us.median``.

        Raises
        ------
        MissingPackageError
            pandas is not installed.
        """
        return pandas().json_normalize(self.sequences).set_index("name")


def bench(
    scenarios: Sequence[str | Scenario] | None = None, *, progress: bool = False
) -> Bench:
    """Times the quadratic program alone and the controller's whole step along closed loops: as ``ballbot bench``.

    Parameters
    ----------
    scenarios
        Scenarios, or names of built-in ones; without, the program's choice, with sequences of problems of other
        sizes and of many active bounds.
    progress
        Whether to show a progress bar (needs tqdm).

    Raises
    ------
    ScenarioError
        A scenario makes no sense, or cannot be timed.
    """
    chosen = _lpvmpc.timed_scenarios() if scenarios is None else scenarios
    loaded = [
        Scenario.builtin(one)
        if isinstance(one, str)
        else instance("scenarios", one, Scenario, "lpvmpc.ballbot.Scenario")
        for one in listed("scenarios", chosen, "a list of names or scenarios")
    ]
    with reported(progress) as report:
        return Bench(*_lpvmpc.bench([one._native for one in loaded], scenarios is None, report))


@dataclass(frozen=True)
class GuaranteeCount:
    """What happened in the closed loops of one variant of plant and controller."""

    variant: str
    """What is varied, in words."""
    is_nominal: bool
    """Whether the plant is the model, so that what is guaranteed must hold."""
    broken_promises: int
    """How often something happened that is guaranteed not to."""
    tally: dict[str, Any]
    """All runs together."""
    records: list[dict[str, Any]]
    """Each run."""


def count_guarantee(
    scenario: Scenario | None = None,
    *,
    runs: int = 10_000,
    samples: int = 100,
    seed: int = 1,
    threads: int = 0,
    progress: bool = False,
) -> list[GuaranteeCount]:
    """Counts in many random closed loops what a guarantee promises, and where it ends: as ``ballbot campaign`` without
    a campaign of your own, with the same numbers.

    Parameters
    ----------
    scenario
        One with a certified terminal set; without, ``far-setpoints``.
    runs
        Closed loops of the nominal plant; every other variant has a twentieth of them.
    samples
        Samples of each closed loop.
    seed
        Seed of everything random.
    threads
        Threads; 0 for one per core. The numbers do not depend on them.
    progress
        Whether to show a progress bar (needs tqdm).

    Raises
    ------
    SettingError
        A number makes no sense.
    ScenarioError
        The scenario makes no sense, or has no guarantee.
    """
    limits = {
        "runs": (runs, 1, 1_000_000),
        "samples": (samples, 1, 100_000),
        "seed": (seed, 0, 2**64 - 1),
        "threads": (threads, 0, 1024),
    }
    for name, (value, least, most) in limits.items():
        whole(name, value, least, most)
    chosen = Scenario.builtin("far-setpoints") if scenario is None else scenario
    native = instance("scenario", chosen, Scenario, "lpvmpc.ballbot.Scenario")._native
    with reported(progress) as report:
        found = _lpvmpc.count_guarantee(native, runs, samples, seed, threads, report)
    return [
        GuaranteeCount(
            one["name"], one["is_nominal"], one["broken_promises"], one["tally"], one["records"]
        )
        for one in found
    ]


def reproduce(*, progress: bool = False) -> list[dict[str, Any]]:
    """What the paper says beside what is computed, number by number: as ``ballbot reproduce``.

    Parameters
    ----------
    progress
        Whether to show a progress bar (needs tqdm).

    Returns
    -------
    list of dict
        Of each number its ``claim``, its ``source``, the ``difference``, and whether it ``agrees``.
    """
    with reported(progress) as report:
        return _lpvmpc.reproduce(report)
