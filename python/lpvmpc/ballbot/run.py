"""Recorded closed loops of a ballbot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ScenarioError
from ._values import pandas

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

STATES = ("phi", "theta", "phi_dot", "theta_dot")
"""The columns of a state: turn of the ball and tilt of the body, rad, and their rates, rad/s."""


@dataclass(frozen=True, eq=False)
class SensorLog:
    """What the sensors of a plane delivered, at their own rate, L rows long."""

    t: Array
    """Times, s, shape (L,)."""
    readings: Array
    """phi, theta, phi_dot, theta_dot, NaN where a reading is missing: shape (L, 4)."""
    commanded: Array
    """The torque commanded from there on, N m, shape (L,)."""
    applied: Array
    """The mean torque of the drive until the next row, N m, shape (L,)."""
    csv: str
    """The same as the text of a file, as ``ballbot simulate --log`` writes it."""


@dataclass(frozen=True, eq=False)
class Motors:
    """The three motors of a robot that moves in two planes, M rows long."""

    t: Array
    """Times, s, shape (M,)."""
    torque: Array
    """Torques, held to the next row, N m, shape (M, 3)."""
    heading: Array
    """How far the robot has turned about the vertical, rad, shape (M,)."""
    heading_reference: Array
    """Where that has to be, rad, shape (M,)."""
    limit: float | None
    """Largest torque of a motor, N m, where the planes share them."""


@dataclass(frozen=True, repr=False, eq=False)
class PlaneRun:
    """One plane's closed loop, K samples long."""

    name: str
    """``"x"`` or ``"y"``; empty where there is one plane."""
    t: Array
    """Times of the samples, s, and of the end: shape (K + 1,)."""
    state: Array
    """phi, theta (rad), phi_dot, theta_dot (rad/s) at these times, shape (K + 1, 4)."""
    reference: Array
    """Their reference, shape (K + 1, 4)."""
    reference_is_held: bool
    """Whether the reference jumps, as set points do."""
    estimate: Array
    """The state that was decided for: measured, estimated or predicted, shape (K, 4)."""
    input: Array
    """The torque held from each sample to the next, N m, shape (K,)."""
    cost: Array
    """The cost J of each plan, shape (K,)."""
    status: tuple[str, ...]
    """What each plan is worth, in words."""
    is_solved: NDArray[np.bool_]
    """Whether there is a plan, shape (K,)."""
    active_bounds: NDArray[np.int64]
    """Bounds that are active in each plan, shape (K,)."""
    gap: Array
    """Rollout of the nonlinear model minus prediction at the end of each plan, in state units, shape (K, 4)."""
    step_time: Array
    """Time that each decision took, s, shape (K,)."""
    decision: tuple[str, ...]
    """What backs each torque, where there is a guarantee; else empty."""
    set_point: Array
    """phi of the artificial set point of each plan, rad, shape (K,), where there is a guarantee; else empty."""
    metrics: dict[str, Any]
    """What the run amounts to, by name: as ``ballbot simulate --json`` has it."""
    lines: tuple[tuple[str, str], ...]
    """The same for people: names with units, and numbers."""
    log: SensorLog
    """What the sensors delivered."""
    readings: str
    """What was wrong with the readings, in words; empty where nothing was."""
    ended_early: str | None
    """Why the run ended early; None where it came to its end."""

    def __getitem__(self, name: str) -> Array:
        """A column by its name: ``phi``, ``theta``, ``phi_dot``, ``theta_dot``, the same with ``_ref``, ``torque``,
        ``cost``, ``step_time`` or ``set_point``."""
        columns = self._columns()
        if name not in columns:
            raise KeyError(f"{name!r}: there are {', '.join(columns)}")
        return columns[name]

    def _columns(self) -> dict[str, Array]:
        columns = {name: self.state[:, i] for i, name in enumerate(STATES)}
        columns |= {f"{name}_ref": self.reference[:, i] for i, name in enumerate(STATES)}
        columns |= {"torque": self.input, "cost": self.cost, "step_time": self.step_time}
        if len(self.set_point):
            columns["set_point"] = self.set_point
        return columns

    def __repr__(self) -> str:
        return f"<PlaneRun {self.name!r}: {len(self.input)} samples, {self.t[-1]:g} s>"


@dataclass(frozen=True, repr=False, eq=False)
class Run:
    """A closed loop of a scenario: of one plane, or of both."""

    title: str
    """The scenario's."""
    t_s: float
    """Sampling time, s."""
    samples: int
    """Samples that were asked for."""
    planes: tuple[PlaneRun, ...]
    """The planes: one, or x and y."""
    motors: Motors | None
    """The motors, where there are two planes."""
    bounds: dict[str, tuple[float, float]]
    """The bounds of states and torque that the controller keeps to, by name."""
    certificate: str | None
    """What its terminal certificate is worth, in words; None without one."""
    metres_per_rad: float
    """How far the ball rolls when phi grows by one radian, m."""

    @classmethod
    def _of(cls, native: Mapping[str, Any]) -> Run:
        motors = native["motors"]
        names = [""] if len(native["planes"]) == 1 else ["x", "y"]
        return cls(
            title=native["title"],
            t_s=native["t_s"],
            samples=native["samples"],
            planes=tuple(map(_plane, names, native["planes"])),
            motors=motors
            and Motors(
                motors["t"],
                motors["torques"],
                motors["headings"],
                motors["heading_references"],
                native["motor_limit"],
            ),
            bounds=native["bounds"],
            certificate=native["certificate"],
            metres_per_rad=native["metres_per_rad"],
        )

    @property
    def t(self) -> Array:
        """Times of the samples, s, and of the end: shape (K + 1,). Where a plane ends early, until then."""
        return min((plane.t for plane in self.planes), key=len)

    @property
    def state(self) -> Array:
        """phi, theta (rad), phi_dot, theta_dot (rad/s) at these times, shape (K + 1, 4); of two planes
        (K + 1, 2, 4)."""
        return self._stacked("state", len(self.t))

    @property
    def reference(self) -> Array:
        """Their reference, of the same shape."""
        return self._stacked("reference", len(self.t))

    @property
    def input(self) -> Array:
        """The torque held from each sample to the next, N m, shape (K,); of two planes (K, 2)."""
        return self._stacked("input", len(self.t) - 1)

    @property
    def cost(self) -> Array:
        """The cost J of each plan, shape (K,); of two planes (K, 2)."""
        return self._stacked("cost", len(self.t) - 1)

    @property
    def metrics(self) -> dict[str, Any]:
        """What the run amounts to, by name; of two planes one such dictionary for ``"x"`` and one for ``"y"``."""
        if len(self.planes) == 1:
            return self.planes[0].metrics
        return {plane.name: plane.metrics for plane in self.planes}

    @property
    def ended_early(self) -> str | None:
        """Why the run ended early; None where it came to its end."""
        told = (
            f"{plane.name}: {plane.ended_early}".removeprefix(": ")
            for plane in self.planes
            if plane.ended_early
        )
        return next(told, None)

    def __getitem__(self, name: str) -> Array:
        """A column by its name, as `PlaneRun` has it; of two planes with the plane's before it, ``"x.phi"``."""
        if len(self.planes) == 1:
            return self.planes[0][name]
        plane, _, column = name.partition(".")
        for one in self.planes:
            if one.name == plane:
                return one[column]
        raise KeyError(f"{name!r}: there are two planes, so it must be 'x.{name}' or 'y.{name}'")

    def _stacked(self, name: str, count: int) -> Array:
        parts: list[Array] = [getattr(plane, name)[:count] for plane in self.planes]
        return parts[0] if len(parts) == 1 else np.stack(parts, axis=1)

    def to_dataframe(self) -> Any:
        """A pandas ``DataFrame`` with the time in s as its index and the columns of `PlaneRun`, with its plans' status,
        active bounds and decision; of two planes ``x.phi`` and so on. The last row, the end, has no torque and no
        plan.

        Raises
        ------
        MissingPackageError
            pandas is not installed.
        """
        pd = pandas()
        frames = []
        for plane in self.planes:
            index = pd.Index(plane.t, name="t")
            columns: dict[str, Any] = dict(plane._columns())
            columns |= {"status": plane.status, "active_bounds": plane.active_bounds}
            if plane.decision:
                columns["decision"] = plane.decision
            prefix = f"{plane.name}." if plane.name else ""
            series = {
                prefix + name: pd.Series(list(column), index=index[: len(column)])
                for name, column in columns.items()
            }
            frames.append(pd.DataFrame(series, index=index))
        return pd.concat(frames, axis=1)

    def plot(self, kind: str | None = None, figure: Figure | None = None) -> Figure:
        """A figure of the run, as the program draws it.

        Parameters
        ----------
        kind
            ``"run"``: states, torque and cost over time, with reference and bounds. ``"plans"``: how far the plans were
            from the model, and what backed each torque. For two planes ``"path"``: the way on the floor, and
            ``"motors"``. Without, ``"run"``.
        figure
            A figure of matplotlib to draw in; a new one without.

        Raises
        ------
        MissingPackageError
            matplotlib is not installed.
        ScenarioError
            There is no such figure of this run, or it has no sample: the robot had fallen at its beginning.
        """
        from . import _plot

        drawn = {"run": _plot.run, "plans": _plot.plans}
        if self.motors is not None:
            drawn |= {"path": _plot.path, "motors": _plot.motors}
        kind = kind or "run"
        if len(self.t) < 2:
            raise ScenarioError("the run has no sample that a figure could show")
        if kind not in drawn:
            raise ScenarioError(f"kind = {kind!r}: it must be one of {', '.join(drawn)}")
        return drawn[kind](self, figure)

    def __str__(self) -> str:
        rows = [("", *(f"{plane.name} plane" if plane.name else "value" for plane in self.planes))]
        lines = [plane.lines for plane in self.planes]
        rows += [(one[0][0], *(value for _, value in one)) for one in zip(*lines, strict=True)]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        table = ["  ".join([f"{row[0]:<{widths[0]}}", *map(str.rjust, row[1:], widths[1:])]) for row in rows]
        early = [f"ended early: {self.ended_early}"] if self.ended_early else []
        return "\n".join([self.title, *table, *early])

    def __repr__(self) -> str:
        early = f", ended early: {self.ended_early}" if self.ended_early else ""
        return f"<Run {self.title!r}: {len(self.t) - 1} samples of {self.t_s} s{early}>"


def _plane(name: str, native: Mapping[str, Any]) -> PlaneRun:
    log = native["log"]
    return PlaneRun(
        name=name,
        t=native["t"],
        state=native["states"],
        reference=native["references"],
        reference_is_held=native["reference_is_held"],
        estimate=native["estimates"],
        input=native["torques"],
        cost=native["costs"],
        status=tuple(native["statuses"]),
        is_solved=native["solved"],
        active_bounds=native["active_bounds"],
        gap=native["gaps"],
        step_time=native["step_times"],
        decision=tuple(native["decisions"]),
        set_point=native["set_points"],
        metrics=native["metrics"],
        lines=tuple(native["lines"]),
        log=SensorLog(log["t"], log["readings"], log["commanded"], log["applied"], native["log_csv"]),
        readings=native["readings"],
        ended_early=native["ended_early"],
    )
