"""Model predictive control of a plant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from . import _lpvmpc
from ._arrays import column, copied, instance, number, whole
from ._preview import check_names
from ._preview import to_native as preview_to_native
from ._settings import designed
from ._settings import to_native as settings_to_native
from .constraints import Limits, Penalty, Row, kept
from .errors import SettingError
from .estimator import Estimate, Estimator, readings_to_native
from .estimator import to_native as estimator_to_native
from .plan import Plan
from .plant import Plant, names_of


class Mpc:
    """A model predictive controller of a plant, with states, inputs and horizon of any size up to
    16, 6 and 1000.

    At every sample it minimises ::

        sum over i = 0 .. N-1 of (x_i - x_ref)'Q (x_i - x_ref) + (u_i - u_ref)'R (u_i - u_ref)
            + (x_N - x_ref)'P (x_N - x_ref)

    over the motion of the nonlinear plant, sampled by Runge-Kutta steps with the input held, within the bounds.
    Each sample solves a few quadratic programs, each an improvement of the plan.

    One thread at a time may use a controller; a call during another's raises ``RuntimeError``. Several controllers work
    side by side in threads of their own.

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
        without one) from there on; a matrix (n, n) or its diagonal; ``"equality"``, x_N = x_ref, and with `r_du` or
        `du_bounds`, where the last input counts as a state, u_{N-1} = u_ref, too; or a
        `Certificate` of this plant, with its cost and its set: the loop is then guaranteed as `Plan.decision` says. Its
        reference is the certificate's equilibrium, but for states that no formula of the plant reads (a cart's
        position): these may be sent anywhere, at every sample, and by stage where it is known ahead. With an
        `estimator` the guarantee is for the model from the estimated state, not for the plant.
    x_bounds, u_bounds
        Bounds of x_1 to x_N and of the inputs: (lower, upper), or by name,
        ``{"position": (-1, 1)}``; a state or input that is not named has those of the plant.
    state_bounds
        What becomes of a plan that cannot keep the bounds of the states: ``"soft"`` (exceeded as little as
        possible, at a price that grows with the distance of the goal), ``"hard"`` (it is none), or prices by
        name, ``{"position": Penalty(1e3)}``; states that are not named are hard then. Where the goal outweighs the
        price of ``"soft"``, a bound that could be kept is exceeded, too: `Plan.active_bounds` has "(exceeded)", and a
        dearer price, or ``"hard"``, keeps it.
    u_ref
        The input that costs nothing, shape (m,). With one, references are tracked as they are. Without, it is the input
        that holds the plant at the end of the reference, or where it can stand nearest to it; and there a constant
        reference is, too: see `step`.
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
        last one that the controller gave, or what `set_last_input` says. The inputs' own bounds come first: where
        these are farther from the last input, the first change is as large as they ask for.
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
        instance("plant", plant, Plant)
        self._plant = plant
        self._designed_for = plant  # the terminal cost stays that of these parameters
        self._settings: dict[str, Any] = copied({
            "t_s": t_s, "horizon": horizon, "q": q, "r": r, "terminal": terminal,
            "x_bounds": x_bounds, "u_bounds": u_bounds, "state_bounds": state_bounds,
            "u_ref": u_ref, "rows": rows, "q_y": q_y, "y_bounds": y_bounds,
            "output_bounds": output_bounds, "r_du": r_du, "du_bounds": du_bounds, "linear_models": linear_models, "nodes": nodes,
            "substeps": substeps, "method": method, "max_programs": max_programs, "first_programs": first_programs,
            "tolerance": tolerance, "estimator": estimator,
        })  # fmt: skip
        self._states, self._inputs = names_of(plant.states), names_of(plant.inputs)
        self._native = _lpvmpc.Mpc(plant._native, settings_to_native(plant, self._settings))
        self._native.set_estimator(self._filter(estimator))

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
        found: dict[str, Any] = copied(self._settings)
        return found

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """The bounds of states, inputs and outputs that it keeps to, by name; infinite where there are none."""
        found: dict[str, tuple[float, float]] = {}
        for name in ("x", "u", "y"):
            signals, lower, upper = kept(self._plant, self._settings, name)
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
        stage on; from where it ends its last entry holds. So one vector is a value for the whole horizon. Of a Series of
        pandas the index, of a DataFrame the columns, of one that is a matrix its rows, too, may be the names of what the numbers are of, in any
        order.

        Parameters
        ----------
        x
            The measured state, shape (n,). One that is not finite is answered by a plan whose
            status says so.
        x_ref
            The reference, (n,) or (stages, n). Without: the plant's equilibrium, or zero. One that is constant over the
            horizon is a set point, unless there is a `u_ref`, here or in the settings: what is tracked is then the steady
            state nearest to it (`Plan.x_target`), by the diagonal of Q and within the bounds. That is the reference itself
            where the plant can stand there. One that changes over the horizon is tracked as it is. With a certificate
            `x_ref` is all that a step may be told.
        u_ref
            The input that costs nothing, (m,) or (stages, m). With one, `x_ref` is tracked as it is, also where the plant
            cannot stand: a cart with Q = diag(0, 1) for position and speed stands still at ``x_ref=[0, 1]``, since with
            another speed it does not stand, and drives at 1 at ``x_ref=[0, 1], u_ref=[0]``. Without, here and in the
            settings, the input that holds the steady state nearest to the end of `x_ref` costs nothing (`Plan.u_target`).
        q, r
            Other weights, both or neither: (n,), (n, n) or (stages, n, n), and so on.
        cross
            S of 2 (u - u_ref)'S (x - x_ref), (m, n) or (stages, m, n).
        linear_x, linear_u
            Linear costs, (n,) or (stages, n), and (m,) or (stages, m).
        x_bounds, u_bounds
            (lower, upper), each (n,) or (stages, n), and (m,) or (stages, m); or by name for the whole horizon,
            ``{"position": (-1, 1)}``: what is not named then has the bounds of the settings. Those of states are as soft
            or hard as `state_bounds` of `Mpc` says.
        rows
            For each stage its linear constraints, in place of those of the settings; from where the list ends its
            last entry holds.
        disturbance
            What is added to f, in state units per second: (n,) or (stages, n).
        parameters
            The plant's parameters in their order, (k,) or (stages, k), checked as by `set_parameters`.
        y_ref
            The reference of the outputs, (k,) or (stages, k). Without `x_ref`, that is where the plant stands
            nearest to it.
        q_y, r_du
            Other weights, where the settings have any: (k,), (k, k) or (stages, k, k), and so on.
        y_bounds, du_bounds
            (lower, upper) of outputs and of changes, each (k,) or (stages, k), and (m,) or (stages, m); or by name, as
            `x_bounds`. Those of outputs are as soft or hard as `output_bounds` of `Mpc` says.
        matrices
            (A, B) or (A, B, c) of x+ = A x + B u + c over the samples, in place of the plant: (n, n) or
            (stages, n, n), and so on. In continuous time a `disturbance` d, per second, then adds (I + A) d t_s / 2.
        scheduling
            The scheduling of the plant's own embedding, whatever the state: (s,) or (stages, s).

        Returns
        -------
        Plan
            The plan; apply ``plan.u0`` until the next sample.

        Raises
        ------
        SettingError
            An array has not the shape that it must have, or an entry that makes no sense; or with the `parameters` the
            steps of the prediction are too long.
        """
        ahead = {
            "u_ref": u_ref, "q": q, "r": r, "cross": cross, "linear_x": linear_x, "linear_u": linear_u,
            "x_bounds": x_bounds, "u_bounds": u_bounds, "rows": rows, "disturbance": disturbance,
            "parameters": parameters, "y_ref": y_ref, "q_y": q_y, "y_bounds": y_bounds, "r_du": r_du,
            "du_bounds": du_bounds, "matrices": matrices, "scheduling": scheduling,
        }  # fmt: skip
        known = preview_to_native(self._plant, self._settings, x_ref, ahead)
        return Plan(*self._native.step(column("x", x, self._states), known))

    def observe(self, t: float, readings: Mapping[str, float | None] | ArrayLike) -> dict[str, str]:
        """Takes in readings of the time `t`; may be called more often than once a sample.

        Parameters
        ----------
        t
            When they were taken, s, on any clock. Of a plant in discrete time they are of its nearest period, counted from
            the first readings.
        readings
            By name, also as a Series of pandas, or in the order of ``estimator.measured``; one that is missing is left out,
            None, NaN or masked.

        Returns
        -------
        dict
            What became of each reading: ``"used"``, ``"used after a blow"`` (after outliers in a row, or the first
            one of a sensor), ``"missing"``, ``"stale"``, ``"repeated"``, ``"outlier"``, ``"not finite"``, ``"not needed"``
            (its variance is infinite).

        Raises
        ------
        SettingError
            The controller has no estimator, or there are not as many readings.
        """
        names = self._measured()
        verdicts = self._native.observe(number("t", t), readings_to_native(names, readings))
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
        check_names(ahead)
        self._measured()
        known = preview_to_native(self._plant, self._settings, x_ref, ahead)
        return Plan(*self._native.decide(known))

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

    def _filter(self, estimator: Estimator | None) -> Any:
        return None if estimator is None else estimator_to_native(self._plant, estimator)

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
        new = {**self._settings, **copied(changes)}
        native = settings_to_native(self._plant, new)
        for name, kept_at in (("t_s", self.t_s), ("horizon", self.horizon)):
            if native[name] != kept_at:
                raise SettingError(f"{name}: it stays at {kept_at}; make another controller")
        self._native.set(native, self._filter(new["estimator"]))
        self._settings, self._designed_for = new, self._plant

    def set_parameters(self, **values: float) -> None:
        """Other values of the plant's parameters from the next step on, all or none. The plant's equilibrium goes along
        with them (`Plant.equilibrium`). The terminal cost stays what it was, also in copies of the controller, until `set`.

        Raises
        ------
        PlantError
            There is no such parameter, or a value is not finite.
        SettingError
            With these values the steps of the prediction are too long, or the readings do not tell the disturbances; or
            the controller has a certificate, which is for the parameters as they are.
        """
        plant = self._plant.with_parameters(**values)
        self._native.set_parameters([(name, float(value)) for name, value in values.items()])
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
        self._native.set_last_input(column("u", u, self._inputs))

    def reset(self) -> None:
        """Forgets the last plan, the last input and what was estimated: the next step is as the first."""
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
        softly, of states, and has the plant itself as a stand-in for a robot. Its terminal cost is this controller's, which
        `set_parameters` leaves as it was.

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
        settings = designed(self._designed_for, self._settings)
        self._plant._native.save_firmware(
            Path(folder),
            settings_to_native(self._plant, settings),
            str(lpvmpc),
            column("x0", x0, self._states),
            None if x_ref is None else column("x_ref", x_ref, self._states),
            whole("samples", samples),
        )

    def __getstate__(self) -> tuple[Plant, dict[str, Any], Plant]:
        return self._designed_for, self._settings, self._plant

    def __setstate__(self, state: tuple[Plant, dict[str, Any], Plant]) -> None:
        """The controller with the same settings, parameters and terminal cost, without the last plan."""
        designed_for, settings, plant = state
        self.__init__(designed_for, **settings)  # type: ignore[misc]
        if plant != designed_for:
            self.set_parameters(**plant.parameters)
            self.reset()

    def __repr__(self) -> str:
        return f"<Mpc of {self._plant.name!r}: {self.horizon} samples of {self.t_s} s>"
