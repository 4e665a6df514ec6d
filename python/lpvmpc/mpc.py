"""Model predictive control of a plant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lpvmpc
from ._arrays import by_stage, column, listed, matrices_by_stage, number, weight
from .certificate import Certificate
from .errors import SettingError
from .estimator import Estimate, Estimator
from .estimator import to_native as estimator_to_native
from .plant import Plant, Signal

Array = NDArray[np.float64]

Limits = Union[
    "tuple[ArrayLike, ArrayLike]", Mapping[str, "tuple[float | None, float | None]"]
]
"""Bounds: (lower, upper), each with a number for every state or input, or by name; None or an
infinite number where there is no bound."""


@dataclass(frozen=True)
class Penalty:
    """The price of exceeding a bound by e: ``linear * e + quadratic * e**2``, in units of the cost."""

    linear: float = 0.0
    quadratic: float = 0.0


@dataclass(frozen=True)
class Row:
    """A linear constraint lower <= x'x_i + u'u_i <= upper at every stage.

    Parameters
    ----------
    name
        What it is called in messages.
    x, u
        The coefficients: by name of a state or an input (others are zero), or one for each.
    lower, upper
        Its bounds; None for none.
    soft
        The price of exceeding it; hard without.
    """

    name: str
    x: Mapping[str, float] | ArrayLike | None = None
    u: Mapping[str, float] | ArrayLike | None = None
    lower: float | None = None
    upper: float | None = None
    soft: Penalty | None = None


@dataclass(frozen=True, slots=True)
class ActiveBound:
    """A bound that a plan runs into."""

    stage: int
    """The stage, from 0 to N."""
    bound: str
    """The bound in words: ``"force >= -10 N"``."""
    multiplier: float
    """Its Lagrange multiplier, in cost per unit of the quantity."""
    exceeded: bool
    """Whether it is a soft bound that is exceeded."""


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Plan:
    """The plan of a sample: what `Mpc.step` answers.

    Whatever the status, the inputs are finite and within their bounds; unless `is_solved` they
    are a fallback, not an optimum.
    """

    u: Array
    """The inputs u_0 to u_{N-1}, shape (N, m), in input units."""
    x: Array
    """The states x_0 to x_N, shape (N + 1, n), in state units: the measured one, and what the model makes
    of the inputs."""
    status: str
    """``"converged"``, ``"improved"``, ``"no improvement"`` (a descent), ``"solved"`` (a fixed number of
    programs), and of those that are no plan ``"infeasible"``, ``"inaccurate"``, ``"max changes"``,
    ``"no memory"``, ``"numerical failure"``, ``"not finite"``, ``"refused"``."""
    message: str
    """The status in words, with the plant's names: ``"infeasible: position <= 0.5 m at stage 7 against
    force >= -10 N at stages 0 to 6"``."""
    is_solved: bool
    """Whether the inputs are a plan: an optimum, or a motion of the nonlinear model that the
    programs confirm or improve."""
    cost: float
    """The cost along `x` and `u`, without the prices of bounds."""
    programs: int
    """How many quadratic programs were solved."""
    _active: list[tuple[int, str, float, bool]]
    active_bounds: str
    """The bounds that hold with equality or are exceeded, in words: ``"force >= -10 N at stages 0
    to 6"``, or ``"no active bound"``."""
    decision: str | None = None
    """With a certificate, what the first input is backed by: ``"new plan"``, ``"candidate"`` (the rest of the last
    plan), ``"terminal law"``; and where no plan is known that keeps the bounds and ends in the certified set,
    ``"soft bounds"`` or ``"saturated LQR"``."""

    @property
    def is_guaranteed(self) -> bool:
        """Whether, with a certificate, there will be a plan at every later sample: states at the samples and inputs
        keep their bounds, and the plan's cost falls by the stage cost while references beyond the horizon stay; while
        the plant is the model, up to the error of its Runge-Kutta steps, for which a thousandth of the bounds is kept,
        its state is known exactly and its input acts at once. Of a plan by `Mpc.decide` it is said of the model alone,
        from the estimated state, under the disturbances beside the inputs as they are estimated then: the plant keeps
        to it as far as the estimate is right and stays."""
        return self.decision in ("new plan", "candidate", "terminal law")

    @property
    def u0(self) -> Array:
        """The input to apply until the next sample, shape (m,)."""
        first: Array = self.u[0]
        return first

    @property
    def active(self) -> list[ActiveBound]:
        """The bounds that hold with equality, or are exceeded at a price, by stage."""
        return [ActiveBound(*one) for one in self._active]

    def __repr__(self) -> str:
        inputs = ", ".join(f"{one:.6g}" for one in self.u0)
        return f"<Plan: {self.message}; u0 = [{inputs}], cost {self.cost:.6g}, {self.active_bounds}>"


class Mpc:
    """A model predictive controller of a plant, with states, inputs and horizon of any size up to
    16, 6 and 1000.

    At every sample it minimises ::

        sum over i = 0 .. N-1 of (x_i - x_ref)'Q (x_i - x_ref) + (u_i - u_ref)'R (u_i - u_ref)
            + (x_N - x_ref)'P (x_N - x_ref)

    over the motion of the nonlinear plant, sampled by Runge-Kutta steps with the input held, within the bounds.
    Each sample solves a few quadratic programs, each an improvement of the plan.

    Parameters
    ----------
    plant
        The plant; its bounds hold unless others are given.
    t_s
        Sampling time, s.
    horizon
        Prediction horizon N in samples, 1 to 1000.
    q
        Q, positive semidefinite: the diagonal, shape (n,), or whole, (n, n).
    r
        R, positive definite: the diagonal, shape (m,), or whole, (m, m).
    terminal
        P: ``"lqr"``, the cost of the linear-quadratic regulator about the plant's equilibrium (about zero
        without one) from there on; a matrix (n, n) or its diagonal; ``"equality"``, x_N = x_ref; or a
        `Certificate` of this plant, with its cost and its set: the loop is then guaranteed as `Plan.decision` says. Its
        reference is the certificate's equilibrium, but for states that no formula of the plant reads (a cart's
        position): these may be sent anywhere, at every sample, and by stage where it is known ahead. With an
        `estimator` the guarantee is for the model from the estimated state, not for the plant.
    x_bounds, u_bounds
        Bounds of x_1 to x_N and of the inputs: (lower, upper), or by name,
        ``{"position": (-1, 1)}``; a state or input that is not named has those of the plant.
    state_bounds
        What becomes of a plan that cannot keep the bounds of the states: ``"soft"`` (exceeded as little as
        possible, at a price that grows with the distance of the goal), ``"hard"`` (infeasible), or prices by
        name, ``{"position": Penalty(1e3)}``; states that are not named are hard then.
    u_ref
        The input that costs nothing, shape (m,). Without, the input that holds the plant at the end of
        the reference.
    rows
        Linear constraints that hold at every stage.
    q_y
        Q_y of (y - y_ref)'Q_y (y - y_ref) on top, for the plant's outputs: (k,) or (k, k).
    y_bounds
        Bounds of the outputs, as of the states; those of the plant without. A constraint h(x, u) <= 0 is an
        output with the upper bound 0.
    output_bounds
        What becomes of a plan that cannot keep them, as `state_bounds`.
    r_du
        R_du of (u_i - u_{i-1})'R_du (u_i - u_{i-1}) on top: (m,) or (m, m).
    du_bounds
        Bounds of the change of the inputs from sample to sample, hard. The input before the first is the
        last one that the controller gave, or what `set_last_input` says.
    linear_models
        Which linear models the programs have: ``"own"`` (the plant's own embedding where it has one,
        else as ``"ray"``), ``"motion"`` (derivatives along the expected motion), or ``"ray"`` (mean
        derivatives from the equilibrium to it).
    nodes
        Nodes of the mean in ``"ray"``, 1 to 16.
    substeps
        Runge-Kutta steps per sample, at least 1.
    method
        ``"descent"``: every program is an improvement of the nonlinear plan, or is not taken; or
        ``"fixed"``: exactly `max_programs`, each answer taken as it is (the paper: one).
    max_programs
        Quadratic programs per sample, at most (descent) or exactly (fixed).
    first_programs
        Quadratic programs, at most, in a sample without a plan from the one before: in the first, after a reset or
        after a plan that was none (descent). Where they are more than `max_programs`, and so many are needed,
        plans from two other beginnings are looked for, with as many for each: three times as many in all.
    tolerance
        A descent ends when the cost falls by less than this part of it.
    estimator
        How the state is found from readings; then `observe` and `decide` take the place of `step`. With a certificate
        its disturbances are beside inputs: one on a state would move the equilibrium.

    Raises
    ------
    SettingError
        A setting makes no sense; the message names it and says what would be right.

    Examples
    --------
    >>> import lpvmpc
    >>> integrator = lpvmpc.Plant.from_matrices(
    ...     [[0, 1], [0, 0]], [[0], [1]], states=["position", "speed"], inputs=["force"],
    ...     bounds={"force": (-1, 1)})
    >>> mpc = lpvmpc.Mpc(integrator, t_s=0.1, horizon=20, q=[1, 0.1], r=[0.01])
    >>> plan = mpc.step([0, 0], x_ref=[1, 0])
    >>> plan.status, plan.u0.tolist(), plan.active_bounds
    ('converged', [1.0], 'force <= 1 at stages 0 to 8, force >= -1 at stages 11 to 15')
    """

    def __init__(
        self,
        plant: Plant,
        t_s: float,
        horizon: int,
        q: ArrayLike,
        r: ArrayLike,
        *,
        terminal: Literal["lqr", "equality"] | ArrayLike = "lqr",
        x_bounds: Limits | None = None,
        u_bounds: Limits | None = None,
        state_bounds: Literal["soft", "hard"] | Mapping[str, Penalty] = "soft",
        u_ref: ArrayLike | None = None,
        rows: Sequence[Row] = (),
        q_y: ArrayLike | None = None,
        y_bounds: Limits | None = None,
        output_bounds: Literal["soft", "hard"] | Mapping[str, Penalty] = "soft",
        r_du: ArrayLike | None = None,
        du_bounds: Limits | None = None,
        linear_models: Literal["own", "motion", "ray"] = "own",
        nodes: int = 2,
        substeps: int = 1,
        method: Literal["descent", "fixed"] = "descent",
        max_programs: int = 8,
        first_programs: int = 50,
        tolerance: float = 1e-5,
        estimator: Estimator | None = None,
    ) -> None:
        if not isinstance(plant, Plant):
            raise SettingError(f"plant: {type(plant).__name__} is no lpvmpc.Plant")
        self._plant = plant
        self._settings: dict[str, Any] = {
            "t_s": t_s, "horizon": horizon, "q": q, "r": r, "terminal": terminal,
            "x_bounds": x_bounds, "u_bounds": u_bounds, "state_bounds": state_bounds,
            "u_ref": u_ref, "rows": tuple(listed("rows", rows, "a list of lpvmpc.Row")), "q_y": q_y, "y_bounds": y_bounds,
            "output_bounds": output_bounds, "r_du": r_du, "du_bounds": du_bounds, "linear_models": linear_models, "nodes": nodes,
            "substeps": substeps, "method": method, "max_programs": max_programs, "first_programs": first_programs,
            "tolerance": tolerance, "estimator": estimator,
        }  # fmt: skip
        self._n, self._m, self._k = len(plant.states), len(plant.inputs), len(plant.outputs)
        self._native = _lpvmpc.Mpc(plant._native, _to_native(plant, self._settings))
        self._set_estimator(estimator)

    @property
    def plant(self) -> Plant:
        """The plant that it controls, with its present parameters."""
        return self._plant

    @property
    def t_s(self) -> float:
        """Sampling time, s."""
        return float(self._settings["t_s"])

    @property
    def horizon(self) -> int:
        """Prediction horizon in samples."""
        return int(self._settings["horizon"])

    @property
    def settings(self) -> dict[str, Any]:
        """The settings as they were given, by the names of the arguments."""
        return dict(self._settings)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """The bounds of states, inputs and outputs that it keeps to, by name; infinite where there are none."""
        found: dict[str, tuple[float, float]] = {}
        plant = self._plant
        for name, signals in (
            ("x_bounds", plant.states), ("u_bounds", plant.inputs), ("y_bounds", plant.outputs),
        ):  # fmt: skip
            lower, upper = _limits(name, self._settings[name] or {}, signals) or ([], [])
            found |= {one.name: (a, b) for one, a, b in zip(signals, lower, upper, strict=True)}
        return found

    def step(
        self,
        x: ArrayLike,
        x_ref: ArrayLike | None = None,
        *,
        u_ref: ArrayLike | None = None,
        q: ArrayLike | None = None,
        r: ArrayLike | None = None,
        cross: ArrayLike | None = None,
        linear_x: ArrayLike | None = None,
        linear_u: ArrayLike | None = None,
        x_bounds: Limits | None = None,
        u_bounds: Limits | None = None,
        rows: Sequence[Sequence[Row]] | None = None,
        disturbance: ArrayLike | None = None,
        parameters: ArrayLike | None = None,
        y_ref: ArrayLike | None = None,
        q_y: ArrayLike | None = None,
        y_bounds: Limits | None = None,
        r_du: ArrayLike | None = None,
        du_bounds: Limits | None = None,
        matrices: tuple[ArrayLike, ...] | None = None,
        scheduling: ArrayLike | None = None,
    ) -> Plan:
        """One sample: from the measured state and what is known ahead to the plan.

        Everything but `x` may be given by stage, an array with one more dimension in front, from the present
        stage on; from where it ends its last entry holds. So one vector is a value for the whole horizon.

        Parameters
        ----------
        x
            The measured state, shape (n,). One that is not finite is answered by a plan whose
            status says so.
        x_ref
            The reference, (n,) or (stages, n). Without: the plant's equilibrium, or zero. With a certificate it is all
            that a step may be told.
        u_ref
            The input that costs nothing, (m,) or (stages, m). With one, `x_ref` is taken as it is.
        q, r
            Other weights, both or neither: (n,), (n, n) or (stages, n, n), and so on.
        cross
            S of 2 (u - u_ref)'S (x - x_ref), (m, n) or (stages, m, n).
        linear_x, linear_u
            Linear costs, (n,) or (stages, n), and (m,) or (stages, m).
        x_bounds, u_bounds
            (lower, upper), each (n,) or (stages, n), and (m,) or (stages, m); or by name for the whole horizon, as of
            `Mpc`. Those of states are as soft or hard as its `state_bounds` say.
        rows
            For each stage its linear constraints, in place of those of the settings; from where the list ends its
            last entry holds.
        disturbance
            What is added to f, in state units per second: (n,) or (stages, n).
        parameters
            The plant's parameters in their order, (k,) or (stages, k).
        y_ref
            The reference of the outputs, (k,) or (stages, k). Without `x_ref`, that is where the plant stands
            nearest to it.
        q_y, r_du
            Other weights, where the settings have any: (k,), (k, k) or (stages, k, k), and so on.
        y_bounds, du_bounds
            (lower, upper) of outputs and of changes, each (k,) or (stages, k), and (m,) or (stages, m); or by name.
        matrices
            (A, B) or (A, B, c) of x+ = A x + B u + c over the samples, in place of the plant: (n, n) or
            (stages, n, n), and so on.
        scheduling
            The scheduling of the plant's own embedding, whatever the state: (s,) or (stages, s).

        Returns
        -------
        Plan
            The plan; apply ``plan.u0`` until the next sample.

        Raises
        ------
        SettingError
            An array has not the shape that it must have, or an entry that makes no sense.
        """
        known = self._known(
            x_ref, u_ref=u_ref, q=q, r=r, cross=cross, linear_x=linear_x, linear_u=linear_u,
            x_bounds=x_bounds, u_bounds=u_bounds, rows=rows, disturbance=disturbance,
            parameters=parameters, y_ref=y_ref, q_y=q_y, y_bounds=y_bounds, r_du=r_du,
            du_bounds=du_bounds, matrices=matrices, scheduling=scheduling,
        )  # fmt: skip
        return Plan(*self._native.step(column("x", x, self._n), known))

    def observe(self, t: float, readings: Mapping[str, float | None] | ArrayLike) -> dict[str, str]:
        """Takes in readings of the time `t`; may be called more often than once a sample.

        Parameters
        ----------
        t
            When they were taken, s, on any clock.
        readings
            By name, or in the order of ``estimator.measured``; one that is missing is left out, None or NaN.

        Returns
        -------
        dict
            What became of each reading: ``"used"``, ``"used after a blow"`` (after outliers in a row, or the first
            one of a sensor), ``"missing"``, ``"stale"``, ``"repeated"``, ``"outlier"``, ``"not finite"``.

        Raises
        ------
        SettingError
            The controller has no estimator, or there are not as many readings.
        """
        names = self._measured()
        if isinstance(readings, Mapping):
            for name in readings:
                if name not in names:
                    raise SettingError(
                        f"readings: {name!r} is not measured; what is, is {', '.join(names)}"
                    )
            given = [readings.get(name) for name in names]
        else:
            given = list(np.atleast_1d(np.asarray(readings, dtype=object)))
        values = [None if one is None else number("readings", one) for one in given]
        missing = [None if one is None or np.isnan(one) else one for one in values]
        verdicts = self._native.observe(number("t", t), missing)
        return dict(zip(names, verdicts, strict=True))

    def decide(self, x_ref: ArrayLike | None = None, **ahead: Any) -> Plan:
        """One sample from the last readings: `step` from the estimated state when the input will act, under the
        estimated disturbances.

        Its first input must be applied (or `set_last_input` say what was): the estimator counts on it. Stage 0 is when it
        acts, the delay after the last readings. While there is no estimate, before the first readings, the plan's status
        is ``"not finite"``, and its inputs are those nearest to zero within the bounds. With a certificate, `Plan.is_guaranteed` is then said of the model
        from that state alone.

        Parameters
        ----------
        x_ref
            The reference, (n,) or (stages, n), as of `step`.
        ahead
            What else `step` may be told, by its names.

        Raises
        ------
        SettingError
            The controller has no estimator; or as `step`.
        """
        for name in ahead:
            if name not in _AHEAD:
                raise SettingError(f"{name}: a step takes no such thing; there are {', '.join(_AHEAD)}")
        self._measured()
        return Plan(*self._native.decide(self._known(x_ref, **dict.fromkeys(_AHEAD) | ahead)))

    @property
    def estimator(self) -> Estimator | None:
        """How the state is found from readings; None where it is measured."""
        found: Estimator | None = self._settings["estimator"]
        return found

    @property
    def estimate(self) -> Estimate | None:
        """The estimate at the last readings; None without an estimator."""
        found = self._native.estimate
        if found is None:
            return None
        x, disturbances = found
        names = self._settings["estimator"].disturbances
        return Estimate(np.array(x), dict(zip(names, disturbances, strict=True)))

    def _measured(self) -> list[str]:
        """The names of the readings."""
        estimator = self._settings["estimator"]
        if estimator is None:
            raise SettingError("estimator: the controller has none; give it one, or call step")
        return list(estimator.measured)

    def _set_estimator(self, estimator: Estimator | None) -> None:
        found = None if estimator is None else estimator_to_native(self._plant, estimator)
        self._native.set_estimator(found)

    def _known(
        self,
        x_ref: ArrayLike | None,
        *,
        u_ref: ArrayLike | None,
        q: ArrayLike | None,
        r: ArrayLike | None,
        cross: ArrayLike | None,
        linear_x: ArrayLike | None,
        linear_u: ArrayLike | None,
        x_bounds: Limits | None,
        u_bounds: Limits | None,
        rows: Sequence[Sequence[Row]] | None,
        disturbance: ArrayLike | None,
        parameters: ArrayLike | None,
        y_ref: ArrayLike | None,
        q_y: ArrayLike | None,
        y_bounds: Limits | None,
        r_du: ArrayLike | None,
        du_bounds: Limits | None,
        matrices: tuple[ArrayLike, ...] | None,
        scheduling: ArrayLike | None,
    ) -> dict[str, Any]:
        """What a step is told, as the native half takes it."""
        n, m, k = self._n, self._m, self._k
        known: dict[str, Any] = {"x_ref": None}
        for name, given, size in (
            ("x_ref", x_ref, n), ("u_ref", u_ref, m), ("linear_x", linear_x, n),
            ("linear_u", linear_u, m), ("disturbance", disturbance, n),
            ("parameters", parameters, len(self._plant.parameters) if parameters is not None else 0),
            ("y_ref", y_ref, k),
        ):  # fmt: skip
            if given is not None:
                known[name] = by_stage(name, given, size)
        if scheduling is not None:
            size = (np.shape(scheduling) or (1,))[-1]
            known["scheduling"] = by_stage("scheduling", scheduling, size)
        for name, given, shape in (
            ("q", q, (n, n)), ("r", r, (m, m)), ("cross", cross, (m, n)), ("q_y", q_y, (k, k)),
            ("r_du", r_du, (m, m)),
        ):  # fmt: skip
            if given is not None:
                known[name] = matrices_by_stage(name, given, shape)
        if (q is None) != (r is None):
            raise SettingError("q, r: give both or neither")
        if q is not None:
            known["q"], known["r"] = _equally_long(known["q"], known["r"])
        for name, bounds in (("x", x_bounds), ("u", u_bounds), ("y", y_bounds), ("du", du_bounds)):
            if bounds is not None:
                known |= _bounds(self._plant, name, bounds)
        if rows is not None:
            stages = listed("rows", rows, "a list of lists of lpvmpc.Row, one for each stage")
            known["rows"] = [
                [_row(self._plant, row) for row in listed("rows", stage, "lists, one for each stage")]
                for stage in stages
            ]
        if matrices is not None:
            known |= _models(matrices, n, m)
        return known

    def set(self, **changes: Any) -> None:
        """Other settings from the next step on, by the names of the arguments of `Mpc`.

        The plan goes on; sampling time and horizon stay.

        Raises
        ------
        SettingError
            A setting makes no sense; the controller is then as it was.
        """
        for name in changes:
            if name not in self._settings:
                raise SettingError(
                    f"{name}: there is no such setting; there are {', '.join(self._settings)}"
                )
        new = {**self._settings, **changes}
        for name in ("t_s", "horizon"):
            if new[name] != self._settings[name]:
                raise SettingError(f"{name}: it stays; make another controller")
        native = _to_native(self._plant, new)
        if "estimator" in changes:
            self._set_estimator(changes["estimator"])
        try:
            self._native.set_settings(native)
        except SettingError:
            self._set_estimator(self._settings["estimator"])
            raise
        self._settings = new

    def set_parameters(self, **values: float) -> None:
        """Other values of the plant's parameters from the next step on.

        Raises
        ------
        PlantError
            There is no such parameter, or a value is not finite; the controller is then as it was.
        """
        plant = self._plant.with_parameters(**values)
        self._native.set_parameters({name: float(value) for name, value in values.items()})
        self._plant = plant

    def set_last_input(self, u: ArrayLike) -> None:
        """What was applied last, shape (m,), if it is not what the last step gave: changes count from there, and an
        estimator predicts with it.

        Before the first step it is what acts already; an estimator without it takes that for zero.

        Raises
        ------
        SettingError
            It is not of shape (m,), or not finite.
        """
        self._native.set_last_input(column("u", u, self._m))

    def reset(self) -> None:
        """Forgets the last plan and what was estimated: the next step is as the first."""
        self._native.reset()

    def save_firmware(
        self,
        folder: str | PathLike[str],
        *,
        lpvmpc: str | PathLike[str],
        x0: ArrayLike,
        x_ref: ArrayLike | None = None,
        samples: int = 100,
    ) -> None:
        """Writes a program for a Cortex-M4F that runs this controller in single precision, without heap: a whole crate of
        Rust for ``cargo build`` and, on an emulated board, ``cargo run``.

        It runs a descent of at most eight programs per sample with one Runge-Kutta step, keeps the bounds of inputs and,
        softly, of states, and has the plant itself as a stand-in for a robot.

        Parameters
        ----------
        folder
            Where to; it must not be there yet.
        lpvmpc
            Where the crate ``lpvmpc`` is, as its Cargo.toml is to say: ``crates/lpvmpc`` of a checkout, as an absolute
            path.
        x0
            Where the stand-in begins, shape (n,).
        x_ref
            Where it is to go, shape (n,); the plant's equilibrium, or zero, without.
        samples
            How many samples it runs.

        Raises
        ------
        SettingError
            The controller has a setting that the program has none of; the message names it.
        PlantError
            A number has no place in single precision, or the folder cannot be written.
        """
        if self._settings["estimator"] is not None:
            raise SettingError("estimator: on a microcontroller it must be left out")
        self._plant._native.save_firmware(
            Path(folder),
            _to_native(self._plant, self._settings),
            str(lpvmpc),
            column("x0", x0, self._n),
            None if x_ref is None else column("x_ref", x_ref, self._n),
            _whole("samples", samples),
        )

    def __getstate__(self) -> tuple[Plant, dict[str, Any]]:
        return self._plant, self._settings

    def __setstate__(self, state: tuple[Plant, dict[str, Any]]) -> None:
        """The controller with the same settings, without the last plan."""
        plant, settings = state
        self.__init__(plant, **settings)  # type: ignore[misc]

    def __repr__(self) -> str:
        return f"<Mpc of {self._plant.name!r}: {self.horizon} samples of {self.t_s} s>"


_AHEAD = (
    "u_ref", "q", "r", "cross", "linear_x", "linear_u", "x_bounds", "u_bounds", "rows", "disturbance",
    "parameters", "y_ref", "q_y", "y_bounds", "r_du", "du_bounds", "matrices", "scheduling",
)  # fmt: skip
"""What a step may be told besides the reference."""


def _to_native(plant: Plant, given: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as the native half takes them."""
    states, inputs = plant.states, plant.inputs
    n, m = len(states), len(inputs)
    settings = dict(given)
    for name, most in (
        ("horizon", 1000), ("nodes", 16), ("substeps", 10_000), ("max_programs", 1_000_000), ("first_programs", 1_000_000),
    ):  # fmt: skip
        settings[name] = _whole(name, given[name], most=most)
    for name, known in (
        ("state_bounds", ("soft", "hard")), ("output_bounds", ("soft", "hard")),
        ("linear_models", ("own", "motion", "ray")), ("method", ("descent", "fixed")),
    ):  # fmt: skip
        by_name = name.endswith("bounds") and isinstance(given[name], Mapping)
        if not by_name and not (isinstance(given[name], str) and given[name] in known):
            raise SettingError(
                f"{name}: it is {given[name]!r}; it must be one of {', '.join(map(repr, known))}"
                + (", or prices by name" if name.endswith("bounds") else "")
            )
    for name in ("t_s", "tolerance"):
        settings[name] = number(name, given[name])
    settings["q"], settings["r"] = weight("q", given["q"], n), weight("r", given["r"], m)
    if isinstance(given["terminal"], Certificate):
        settings["terminal"] = (given["terminal"].to_json(),)
    elif not isinstance(given["terminal"], str):
        settings["terminal"] = weight("terminal", given["terminal"], n)
    settings["x_bounds"] = _limits("x_bounds", given["x_bounds"], states)
    settings["u_bounds"] = _limits("u_bounds", given["u_bounds"], inputs)
    if isinstance(given["state_bounds"], Mapping):
        settings["state_bounds"] = _prices("state_bounds", given["state_bounds"], states)
    if given["u_ref"] is not None:
        settings["u_ref"] = column("u_ref", given["u_ref"], m)
    outputs = plant.outputs
    for name, size in (("q_y", len(outputs)), ("r_du", m)):
        if given[name] is not None:
            settings[name] = weight(name, given[name], size)
    settings["y_bounds"] = _limits("y_bounds", given["y_bounds"], outputs)
    settings["du_bounds"] = _limits("du_bounds", given["du_bounds"], _changes(plant))
    if isinstance(given["output_bounds"], Mapping):
        settings["output_bounds"] = _prices("output_bounds", given["output_bounds"], outputs)
    settings["rows"] = [_row(plant, row) for row in given["rows"]]
    del settings["estimator"]
    return settings


def _whole(name: str, given: Any, least: int = 1, most: int = 2**31) -> int:
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool) and least <= given <= most:
        return int(given)
    raise SettingError(f"{name}: it is {given!r}; it must be a whole number from {least} to {most}")


def _changes(plant: Plant) -> list[Signal]:
    """What the inputs are called where their changes are meant: these have no bounds of the plant."""
    return [Signal(one.name) for one in plant.inputs]


def _pair(place: str, given: Any) -> tuple[Any, Any]:
    try:
        lower, upper = given
    except (TypeError, ValueError):
        raise SettingError(f"{place}: it must be (lower, upper)") from None
    return lower, upper


def _open(given: Any, infinite: float) -> Any:
    """Bounds with an infinite one for None."""
    if isinstance(given, (list, tuple)):
        return [infinite if one is None else _open(one, infinite) for one in given]
    return given


def _limits(
    place: str, given: Limits | None, signals: list[Signal]
) -> tuple[list[float], list[float]] | None:
    if given is None:
        return None
    if isinstance(given, Mapping):
        names = [signal.name for signal in signals]
        for name in given:
            if name not in names:
                raise SettingError(f"{place}: there is no {name!r}; there are {', '.join(names)}")
        pairs = [
            _pair(f"{place}, {signal.name}", given[signal.name])
            if signal.name in given
            else (signal.lower, signal.upper)
            for signal in signals
        ]
        lower, upper = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    else:
        lower, upper = _pair(place, given)
    size = len(signals)
    return (
        column(f"{place}, lower", _open(lower, -np.inf), size).tolist(),
        column(f"{place}, upper", _open(upper, np.inf), size).tolist(),
    )


def _bounds(plant: Plant, name: str, given: Limits) -> dict[str, Array]:
    """Bounds by stage, or by name for all stages, as the native half takes them."""
    signals = {
        "x": plant.states, "u": plant.inputs, "y": plant.outputs, "du": _changes(plant),
    }[name]  # fmt: skip
    place, size = f"{name}_bounds", len(signals)
    if isinstance(given, Mapping):
        given = _limits(place, given, signals) or ([], [])
    lower, upper = _pair(place, given)
    lower, upper = _equally_long(
        by_stage(f"{place}, lower", _open(lower, -np.inf), size),
        by_stage(f"{place}, upper", _open(upper, np.inf), size),
    )
    return {f"{name}_lower": lower, f"{name}_upper": upper}


def _price(place: str, price: Any) -> tuple[float, float]:
    if not isinstance(price, Penalty):
        raise SettingError(f"{place}: {price!r} is no Penalty(linear, quadratic)")
    return number(place, price.linear), number(place, price.quadratic)


def _prices(
    place: str, given: Mapping[str, Penalty], signals: list[Signal]
) -> list[tuple[float, float] | None]:
    names = [signal.name for signal in signals]
    for name in given:
        if name not in names:
            raise SettingError(f"{place}: there is no {name!r}; there are {', '.join(names)}")
    return [_price(f"{place}, {name}", given[name]) if name in given else None for name in names]


def _models(given: tuple[ArrayLike, ...], n: int, m: int) -> dict[str, Array]:
    """(A, B) or (A, B, c) by stage."""
    if not isinstance(given, (tuple, list)) or len(given) not in (2, 3):
        raise SettingError("matrices: they must be (A, B) or (A, B, c)")
    a, b = _equally_long(
        matrices_by_stage("matrices, A", given[0], (n, n)),
        matrices_by_stage("matrices, B", given[1], (n, m)),
    )
    found = {"a": a, "b": b}
    if len(given) == 3:
        found["c"] = by_stage("matrices, c", given[2], n)
    return found


def _row(plant: Plant, row: Row) -> tuple[Any, ...]:
    if not isinstance(row, Row):
        raise SettingError(f"rows: {row!r} is no lpvmpc.Row")
    place = f"rows, {row.name}"
    of_x = _coefficients(f"{place}, x", row.x, plant.states)
    of_u = _coefficients(f"{place}, u", row.u, plant.inputs)
    if not any(of_x + of_u):
        raise SettingError(f"{place}: it has no coefficient, of a state (x) or of an input (u)")
    if row.lower is None and row.upper is None:
        raise SettingError(f"{place}: it has neither a lower nor an upper bound")
    return (
        str(row.name),
        of_x,
        of_u,
        -np.inf if row.lower is None else number(f"{place}, lower", row.lower),
        np.inf if row.upper is None else number(f"{place}, upper", row.upper),
        None if row.soft is None else _price(f"{place}, soft", row.soft),
    )


def _coefficients(place: str, given: Any, signals: list[Signal]) -> list[float]:
    if given is None:
        return [0.0] * len(signals)
    if isinstance(given, Mapping):
        names = [signal.name for signal in signals]
        for name in given:
            if name not in names:
                raise SettingError(f"{place}: there is no {name!r}; there are {', '.join(names)}")
        return [number(place, given.get(name, 0.0)) for name in names]
    found: list[float] = column(place, given, len(signals)).tolist()
    return found


def _equally_long(one: Array, other: Array) -> tuple[Array, Array]:
    """Two lists by stage, the last entry of the shorter one repeated."""
    stages = max(len(one), len(other))

    def extended(array: Array) -> Array:
        missing = stages - len(array)
        return np.concatenate([array, np.repeat(array[-1:], missing, axis=0)]) if missing else array

    return extended(one), extended(other)
