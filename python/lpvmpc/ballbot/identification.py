"""From logs to a robot, and what to log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _lpvmpc
from .._arrays import column, listed, numbers, numbers_or_none, whole
from .._progress import reported
from ..errors import IdentificationError, SettingError
from .._files import read, save
from ._values import plain
from .run import Run, SensorLog

Array = NDArray[np.float64]

Recording = Union[str, PathLike[str], Run, SensorLog, Mapping[str, ArrayLike]]
"""The path of a CSV file; a run of one plane, or what its sensors delivered; or columns by name, with NaN, None or a masked
entry where a reading is missing."""

Config = Union[str, PathLike[str], Mapping[str, Any]]
"""The path of a configuration (TOML), or its keys and values."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A plane's segments, measured and simulated with the identified robot, one after the other, N rows together."""

    t: Array
    """Times, s, shape (N,)."""
    measured: Array
    """phi, theta (rad), theta_dot (rad/s), shape (N, 3)."""
    simulated: Array
    """The same of the model, shape (N, 3)."""
    torque: Array
    """N m, shape (N,)."""
    segment: NDArray[np.int64]
    """Number of the segment, from 0 on, shape (N,)."""
    log: NDArray[np.int64]
    """Number of the log, from 0 on, shape (N,)."""


@dataclass(frozen=True, repr=False, eq=False)
class IdentifiedRobot:
    """A robot that explains logs, and what speaks for and against it."""

    summary: dict[str, Any]
    """Everything in numbers: as ``ballbot identify --json`` has it."""
    verdicts: tuple[str, ...]
    """What speaks for and against it, in words."""
    refusals: tuple[str, ...]
    """Why it must not be used; empty where it may."""
    keys: tuple[str, ...]
    """The parameters that were found."""
    covariance: Array
    """Their covariance, shape (n, n)."""
    fits: tuple[Fit, ...]
    """Measurement and model, plane by plane."""
    files: dict[str, str]
    """The texts of its parameter files by their names; empty where it must not be used."""

    @property
    def is_usable(self) -> bool:
        """Whether nothing forbids to use it."""
        return not self.refusals

    @property
    def values(self) -> dict[str, float]:
        """The parameters by name, in the units of `summary`."""
        return {key: one["value"] for key, one in self.summary["parameters"].items()}

    def __getitem__(self, parameter: str) -> float:
        """A parameter by its name."""
        if parameter not in self.values:
            raise KeyError(f"{parameter!r}: there are {', '.join(self.values)}")
        return self.values[parameter]

    def save(self, folder: str | PathLike[str], overwrite: bool = False) -> list[Path]:
        """Writes its parameter files: for the key ``parameters`` of a scenario.

        Parameters
        ----------
        folder
            The folder; it is made if there is none.
        overwrite
            Whether files that are there are replaced.

        Returns
        -------
        list of Path
            The files.

        Raises
        ------
        IdentificationError
            It must not be used; the message says why.
        FileExistsError
            A file is there and is not to be replaced. Nothing is written then.
        OSError
            A file cannot be written.
        """
        if self.refusals:
            raise IdentificationError("no robot explains the logs:\n- " + "\n- ".join(self.refusals))
        paths = {Path(folder) / name: text for name, text in self.files.items()}
        for path in paths:
            if path.exists() and not overwrite:
                raise FileExistsError(f"{path}: it is there; overwrite=True replaces it")
        Path(folder).mkdir(parents=True, exist_ok=True)
        for path, text in paths.items():
            save(text, path, overwrite)
        return list(paths)

    def __str__(self) -> str:
        rows = []
        for key, one in self.summary["parameters"].items():
            deviation = one.get("standard_deviation")
            spread = "" if deviation is None else f" +- {deviation:.2g}"
            rows.append(f"{key:<28} {one['value']:.6g}{spread} {one['unit']} ({one['status']})")
        return "\n".join([*rows, *self.verdicts])

    def __repr__(self) -> str:
        usable = "" if self.is_usable else ", not to be used"
        return f"<IdentifiedRobot: {', '.join(self.keys)}{usable}>"


def identify(
    recordings: Sequence[Recording],
    config: Config | None = None,
    *,
    leave_out: Sequence[tuple[float, float] | tuple[int, float, float]] = (),
    physical: bool = True,
    progress: bool = False,
) -> IdentifiedRobot:
    """Finds the robot that explains logs: as ``ballbot identify``, with the same numbers.

    Parameters
    ----------
    recordings
        Runs of one robot. Columns that are given as arrays are taken as those of a file would be: by default ``t_s``,
        ``phi_rad``, ``theta_rad``, ``theta_dot_rad_s`` and ``torque_commanded_nm``; NaN is a missing reading.
    config
        Columns, units, lengths, priors; without, the paper's lengths. `identification_example` has all keys.
    leave_out
        Parts that are left out, (from, to) in s since the first row, or (log, from, to), logs counted from 1.
    physical
        Whether to impose mechanics.
    progress
        Whether to show a progress bar (needs tqdm).

    Returns
    -------
    IdentifiedRobot
        The robot. **Look at** `IdentifiedRobot.is_usable`, or `save` it, which refuses what must not be used.

    Raises
    ------
    IdentificationError
        A log cannot be read or understood, or nothing can be found from it.
    SettingError
        The configuration makes no sense.
    """
    recordings = listed("recordings", recordings, "a list of recordings, of one too")
    if not recordings:
        raise SettingError("recordings: it is empty; at least one is needed")
    given = listed("leave_out", leave_out, "a list of (from, to) or (log, from, to)")
    parts = [_part(i, part, len(recordings)) for i, part in enumerate(given)]
    with TemporaryDirectory(prefix="lpvmpc-") as folder, reported(progress) as report:
        paths = [_path(i, one, folder) for i, one in enumerate(recordings)]
        found = _lpvmpc.identify(paths, _content(config), parts, not physical, report)
    return IdentifiedRobot(
        summary=found["summary"],
        verdicts=tuple(found["verdicts"]),
        refusals=tuple(found["refusals"]),
        keys=tuple(found["keys"]),
        covariance=found["covariance"],
        fits=tuple(Fit(**fit) for fit in found["planes"]),
        files=dict(found["files"]),
    )


def identification_example() -> str:
    """The text of a configuration with comments, to be changed."""
    return _lpvmpc.identification_example()


@dataclass(frozen=True, repr=False, eq=False)
class Excitation:
    """A torque that makes a robot move so that its log tells the parameters; it is added to that of the loop."""

    t: Array
    """Times, s, shape (N,)."""
    torque: Array
    """N m, shape (N,)."""
    frequencies: Array
    """Frequencies of the harmonics, Hz."""
    gain: Array
    """Gains of the loop u = -K x that it is for, N m per rad and per rad/s, shape (4,)."""
    amplitude: float
    """Its largest torque, N m."""
    amplitude_asked: float
    """What was asked for; more than `amplitude` where the tilt limits it."""
    largest_tilt: float
    """Largest tilt to be expected, rad."""
    largest_torque: float
    """Largest torque to be expected with that of the loop, N m."""
    largest_travel: float
    """Largest way to be expected, m."""
    parameters: dict[str, tuple[float, float, str]]
    """Of each parameter its expected value, the standard deviation that the log will tell it with (the Cramer-Rao
    bound), and its unit."""
    csv: str
    """The text of its file."""

    def save(self, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Writes it as CSV.

        Parameters
        ----------
        path
            The file.
        overwrite
            Whether a file that is there is replaced.

        Raises
        ------
        FileExistsError
            The file is there and is not to be replaced.
        OSError
            The file cannot be written.
        """
        save(self.csv, path, overwrite)

    def __repr__(self) -> str:
        return f"<Excitation: {self.amplitude:.3g} N m for {self.t[-1]:.3g} s>"


def excite(
    config: Config | None = None,
    *,
    parameters: str | PathLike[str] | None = None,
    band: tuple[float, float] | None = None,
    harmonics: int | None = None,
    amplitude: float | None = None,
    length: float | None = None,
    tilt_limit_deg: float | None = None,
    rate: float | None = None,
    gain: Sequence[float] | None = None,
) -> Excitation:
    """Designs a torque that tells the parameters: as ``ballbot excite``. What is not given is as there.

    Parameters
    ----------
    config
        A configuration of `identify`: lengths, noise, priors.
    parameters
        The path of a parameter file of `IdentifiedRobot.save`: what is known of the robot, its lengths too.
        A configuration of other lengths is refused.
    band
        Lowest and highest frequency, Hz.
    harmonics
        How many frequencies.
    amplitude
        Largest torque, N m.
    length
        How long, s.
    tilt_limit_deg
        Largest tilt, degrees; the torque is reduced until it is kept.
    rate
        Rows per second of loop and log.
    gain
        Gains K of your loop u = -K x, N m per rad and per rad/s, four.

    Raises
    ------
    IdentificationError
        There is no such excitation; the message says what is wrong with what was asked.
    SettingError
        The configuration or the parameter file makes no sense, or something that was asked is no number.
    """
    of_numbers = {
        "amplitude": amplitude, "length": length, "tilt_limit_deg": tilt_limit_deg, "rate": rate,
    }  # fmt: skip
    asked: dict[str, Any] = {**numbers_or_none(of_numbers)}
    asked["harmonics"] = None if harmonics is None else whole("harmonics", harmonics, least=0)
    asked["band"] = None if band is None else tuple(column("band", band, 2).tolist())
    asked["gain"] = None if gain is None else column("gain", gain, 4).tolist()
    known = None if parameters is None else fspath(parameters)
    return Excitation(**_lpvmpc.excite(_content(config), known, asked))


def _content(config: Config | None) -> tuple[Any, str] | None:
    """What stands in a configuration, and what messages call it."""
    if config is None:
        return None
    if isinstance(config, Mapping):
        return plain(config), "config"
    try:
        return read(config), fspath(config)
    except OSError as error:
        raise SettingError(f"config: {error}") from error


def _path(place: int, recording: Recording, folder: str) -> str:
    if isinstance(recording, (str, PathLike)):
        return fspath(recording)
    if isinstance(recording, Run):
        if len(recording.planes) != 1:
            raise SettingError(
                f"recordings[{place}]: a run of two planes has two logs, planes[0].log and planes[1].log"
            )
        recording = recording.planes[0].log
    if isinstance(recording, SensorLog):
        text = recording.csv
    elif isinstance(recording, Mapping):
        text = _csv(place, recording)
    else:
        kind = type(recording).__name__
        raise SettingError(f"recordings[{place}]: {kind} is no path, run, or table of columns")
    path = Path(folder) / f"recording-{place + 1}.csv"
    path.write_text(text, encoding="utf-8")
    return fspath(path)


def _csv(place: int, columns: Mapping[str, ArrayLike]) -> str:
    arrays = {name: _readings(f"recordings[{place}], {name}", column) for name, column in columns.items()}
    shapes = {name: array.shape for name, array in arrays.items()}
    if len(set(shapes.values())) != 1 or len(next(iter(shapes.values()))) != 1:
        raise SettingError(f"recordings[{place}]: its columns have the shapes {shapes}; they must be equally long")
    rows = (
        ",".join("" if np.isnan(cell) else repr(float(cell)) for cell in row)
        for row in zip(*arrays.values(), strict=True)
    )
    return "\n".join([",".join(arrays), *rows]) + "\n"


def _readings(place: str, column: ArrayLike) -> Array:
    """The readings of a column, NaN where one is missing: masked, or None."""
    # As objects, since whole numbers have no NaN.
    return numbers(place, np.ma.asarray(column, dtype=object).filled(np.nan) if np.ma.is_masked(column) else column)


def _part(place: int, part: Any, logs: int) -> tuple[int | None, float, float]:
    found = numbers(f"leave_out[{place}]", part)
    if found.shape not in ((2,), (3,)):
        raise SettingError(f"leave_out[{place}]: {part!r} is neither (from, to) nor (log, from, to)")
    log, start, end = (None, *found.tolist()) if len(found) == 2 else found.tolist()
    if log is not None and not (log == int(log) and 1 <= log <= logs):
        raise SettingError(f"leave_out[{place}]: the log is {log}; it must be from 1 to {logs}")
    if not (np.isfinite(start) and np.isfinite(end) and start < end):
        raise SettingError(f"leave_out[{place}]: it is from {start} s to {end} s; the end must be later")
    return None if log is None else int(log), float(start), float(end)
