"""Closed loops on a simulated plant."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lpvmpc
from ._arrays import column, instance, listed, number, numbers, ordered
from ._progress import samples_of
from .errors import MissingPackageError, SettingError, SimulationError
from .mpc import Mpc
from .plan import Plan
from .plant import Plant, Signal, names_of
from .world import Actuator, Jump, Load, Sensor, actuators_of, push_of, seed_of, sensors_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

MOST_SAMPLES = 10_000_000
"""The longest run; it has to fit into memory."""

Reference = Union[ArrayLike, Callable[[float], ArrayLike], None]
"""A constant reference, (n,) of states or (m,) of inputs, one by sample, (samples, n) or (samples, m), whose last row holds
from its end, or a function of time."""


@dataclass(frozen=True, repr=False, eq=False)
class Run:
    """A closed loop from beginning to end, K samples long."""

    plant: Plant
    """The simulated plant."""
    t: Array
    """Times of the samples, s, and of the end: shape (K + 1,)."""
    x: Array
    """The true states at these times, shape (K + 1, n)."""
    u: Array
    """The commanded inputs, shape (K, m)."""
    y: Array
    """The outputs at the samples, under the input there, shape (K, k)."""
    readings: Array
    """What the sensors delivered, NaN where nothing arrived: shape (K, sensors). They are those of the states, or what
    the controller's estimator measures."""
    x_measured: Array
    """What the controller took for the state at the sample, shape (K, n): measured, or estimated."""
    x_ref: Array | None
    """The reference at the samples, shape (K, n); None where there was none."""
    disturbances: dict[str, Array] = field(default_factory=dict)
    """The disturbances that the controller's estimator found, by name: shape (K,) each."""
    plans: list[Plan] = field(default_factory=list)
    """The plans, where the controller is an `Mpc`."""
    step_times: Array = field(default_factory=lambda: np.zeros(0))
    """How long the controller took for each sample, s, shape (K,)."""
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)
    """The bounds that the controller kept to, by name."""

    def __getitem__(self, name: str) -> Array:
        """The column of a state, an input or an output by its name."""
        for signals, table in (
            (self.plant.states, self.x), (self.plant.inputs, self.u), (self.plant.outputs, self.y),
        ):  # fmt: skip
            for i, signal in enumerate(signals):
                if signal.name == name:
                    found: Array = table[:, i]
                    return found
        raise KeyError(f"{name!r}: there are {', '.join(self._names())}")

    def _names(self) -> list[str]:
        plant = self.plant
        return [one.name for one in (*plant.states, *plant.inputs, *plant.outputs)]

    @property
    def status(self) -> list[str]:
        """The status of each sample's plan."""
        return [plan.status for plan in self.plans]

    @property
    def is_solved(self) -> bool:
        """Whether every sample of an `Mpc` had a plan; of a function, which has none, True."""
        return all(plan.is_solved for plan in self.plans)

    def cost(self, q: ArrayLike, r: ArrayLike, u_ref: ArrayLike | None = None) -> float:
        """The closed-loop cost: the sum over the samples of (x - x_ref)'Q (x - x_ref) +
        (u - u_ref)'R (u - u_ref). Of a run without a reference, x_ref is the plant's equilibrium, or zero without one.

        Parameters
        ----------
        q, r
            The weights: diagonals, (n,) and (m,), or whole.
        u_ref
            The input that costs nothing, (m,), or sample by sample, (samples, m); zero without.

        Raises
        ------
        SettingError
            A shape does not fit, or a number is not finite.
        """
        from ._arrays import by_stage, finite, weight

        n, m = self.x.shape[1], self.u.shape[1]
        of_x, of_u = names_of(self.plant.states), names_of(self.plant.inputs)
        q_matrix, r_matrix = finite("q", weight("q", q, of_x)), finite("r", weight("r", r, of_u))
        rest = np.zeros(n) if self.plant.equilibrium is None else self.plant.equilibrium[0]
        e = self.x[:-1] - (rest if self.x_ref is None else self.x_ref)
        known = np.zeros((1, m)) if u_ref is None else finite("u_ref", by_stage("u_ref", u_ref, of_u))
        if len(known) not in (1, len(self.u)):
            raise SettingError(f"u_ref: it has {len(known)} rows; the run has {len(self.u)} samples")
        v = self.u - known
        return float(np.einsum("ki,ij,kj", e, q_matrix, e) + np.einsum("ki,ij,kj", v, r_matrix, v))

    def to_dataframe(self) -> Any:
        """A pandas ``DataFrame`` with the time in s as its index and a column for each state, input, output
        and reference, ``position_ref`` of a state ``position`` (with one more ``_`` where a signal has that name); the last
        row, the end, has no input.

        Raises
        ------
        MissingPackageError
            pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError as error:
            raise MissingPackageError(
                "this needs pandas: pip install pandas, or pip install lpvmpc[pandas]"
            ) from error
        columns: dict[str, Array] = {}

        def put(signals: Sequence[Signal], table: Array, suffix: str = "") -> None:
            for i, signal in enumerate(signals):
                values = np.full(len(self.t), np.nan)
                values[: len(table)] = table[:, i]
                name = signal.name + suffix
                while name in columns:
                    name += "_"
                columns[name] = values

        put(self.plant.states, self.x)
        put(self.plant.inputs, self.u)
        put(self.plant.outputs, self.y)
        if self.x_ref is not None:
            put(self.plant.states, self.x_ref, "_ref")
        return pd.DataFrame(columns, index=pd.Index(self.t, name="t"))

    def plot(self, signals: Sequence[str] | None = None, figure: Figure | None = None) -> Figure:
        """A figure of the run: each state, input and output over time, with its reference and its bounds.

        Parameters
        ----------
        signals
            Names of those to be shown; all without.
        figure
            A figure of matplotlib to draw in; a new one without.

        Raises
        ------
        MissingPackageError
            matplotlib is not installed.
        """
        from ._plot import plot_run

        return plot_run(self, signals, figure)

    def __repr__(self) -> str:
        return f"<Run of {self.plant.name!r}: {len(self.u)} samples, {self.t[-1]:g} s>"


Controller = Union[Mpc, Callable[[float, Array], ArrayLike]]
"""An `Mpc`, or a function of time in s and the measured state (n,) that returns the input (m,)."""


def simulate(
    plant: Plant,
    controller: Controller,
    x0: ArrayLike,
    duration: float,
    x_ref: Reference = None,
    *,
    u_ref: Reference = None,
    t_s: float | None = None,
    sensors: Mapping[str, Sensor] | None = None,
    actuators: Mapping[str, Actuator] | None = None,
    delay: float = 0.0,
    disturbances: Sequence[Load | Jump] = (),
    seed: int = 0,
    relative_tolerance: float = 1e-9,
    absolute_tolerance: float = 1e-9,
    progress: bool = False,
) -> Run:
    """A controller on a simulated plant, which moves in continuous time, or in steps of its own period.

    A controller with an estimator gets the readings of what it measures, the others the whole state.

    Parameters
    ----------
    plant
        The plant as it really is; it may have other parameters than the controller's.
    controller
        An `Mpc`, or a function of time (s) and measured state.
    x0
        The state at time 0, shape (n,).
    duration
        How long, s; a whole number of samples, rounded up.
    x_ref
        The reference: constant, by sample, or a function of time. An `Mpc` sees it ahead over its horizon, from when
        its input acts; where it is constant, and there is no `u_ref`, it goes to the nearest steady state (`Mpc.step`).
    u_ref
        The input that costs nothing, for an `Mpc`, which sees it ahead as `x_ref`: constant, by sample, or a function of
        time.
    t_s
        The sampling time, s, of a controller that is a function.
    sensors
        What is wrong with what is measured, by name of a state, or of an output that an estimator measures; the
        others are measured perfectly.
    actuators
        What is wrong with the inputs, by name.
    delay
        Time from a command to its arrival at the plant, s. Before the first arrives the input is zero.
    disturbances
        Loads and jumps.
    seed
        Seed of the noise: the same seed, the same run.
    relative_tolerance, absolute_tolerance
        Of the integration of the plant (Dormand-Prince 5(4), adaptive).
    progress
        Whether to show a progress bar (needs tqdm).

    Returns
    -------
    Run
        What happened.

    Raises
    ------
    SettingError
        An argument makes no sense; the message names it.
    SimulationError
        The motion cannot be integrated: it became infinite, or a controller's input is not finite. The
        message says when.

    Examples
    --------
    >>> import lpvmpc
    >>> cart = lpvmpc.Plant.from_matrices([[0, 1], [0, 0]], [[0], [1]], states=["position", "speed"])
    >>> mpc = lpvmpc.Mpc(cart, t_s=0.1, horizon=20, q=[1, 0.1], r=[0.1], u_bounds=([-1], [1]))
    >>> run = lpvmpc.simulate(cart, mpc, x0=[0, 0], duration=8, x_ref=[1, 0])
    >>> float(run["position"][-1].round(3)), run.is_solved
    (1.0, True)
    """
    instance("plant", plant, Plant)
    states, inputs = plant.states, plant.inputs
    n, m = len(states), len(inputs)
    mpc = controller if isinstance(controller, Mpc) else None
    if mpc is not None:
        known_to_it = (len(mpc._states), len(mpc._inputs))
        if known_to_it != (n, m):
            raise SettingError(
                f"controller: it is for {known_to_it[0]} states and {known_to_it[1]} inputs; the plant has {n} and {m}"
            )
        for what, ours, theirs in (("states", states, mpc._states), ("inputs", inputs, mpc._inputs)):
            if any(name in theirs and name != theirs[i] for i, name in enumerate(names_of(ours))):
                raise SettingError(
                    f"controller: its {what} are {', '.join(theirs)}, and those of the plant {', '.join(names_of(ours))}; what "
                    "has the same name must stand at the same place"
                )
        if t_s is not None and t_s != mpc.t_s:
            raise SettingError(f"t_s: it is {t_s} s, and that of the controller {mpc.t_s} s")
        period = mpc.t_s
    elif t_s is None:
        raise SettingError("t_s: a controller that is a function needs a sampling time")
    else:
        period = number("t_s", t_s)
    if not callable(controller) and mpc is None:
        raise SettingError(f"controller: {type(controller).__name__} is neither an Mpc nor a function")
    if not (np.isfinite(period) and period > 0):
        raise SettingError(f"t_s: it is {period} s; it must be a positive number of seconds")
    duration = number("duration", duration)
    if not (np.isfinite(duration) and duration > 0):
        raise SettingError(f"duration: it is {duration} s; it must be a positive number of seconds")
    samples = np.ceil(duration / period - 1e-9)
    if samples < 1:
        raise SettingError(f"duration: it is {duration} s; it must be at least one sample of {period} s")
    if samples > MOST_SAMPLES:
        raise SettingError(
            f"duration: {duration} s are {samples:.4g} samples of {period} s; there is room for {MOST_SAMPLES}"
        )
    count = int(samples)
    horizon = mpc.horizon if mpc is not None else 0
    reference = None if x_ref is None else _reference("x_ref", x_ref, names_of(states), count, period)
    estimator = None if mpc is None else mpc.estimator
    acts = 0.0 if estimator is None else float(estimator.delay)
    ahead = {
        place: _reference(place, given, names_of(signals), count + horizon + 1, period, acts)
        for place, given, signals in (("x_ref", x_ref, states), ("u_ref", u_ref, inputs))
        if mpc is not None and given is not None
    }
    pushes = listed("disturbances", disturbances, "a list of lpvmpc.Load and lpvmpc.Jump")
    world = _lpvmpc.World(
        plant._native,
        column("x0", x0, names_of(states)),
        {
            "period": period,
            "sensors": sensors_of(sensors, plant, estimator),
            "actuators": actuators_of(actuators, inputs),
            "delay": number("delay", delay),
            "pushes": [push_of(i, push, names_of(states)) for i, push in enumerate(pushes)],
            "seed": seed_of(seed),
            "relative_tolerance": number("relative_tolerance", relative_tolerance),
            "absolute_tolerance": number("absolute_tolerance", absolute_tolerance),
        },
    )
    if mpc is not None:
        mpc.reset()
    return _run(plant, controller, mpc, world, count, period, _Known(reference, ahead), progress)


@dataclass(frozen=True)
class _Known:
    """What a controller is told besides the readings."""

    reference: Array | None
    """The reference at the samples, for the result."""
    ahead: dict[str, Array]
    """The references, `x_ref` and `u_ref`, from when the input of the first sample acts, beyond the last sample by a
    horizon."""


def _run(
    plant: Plant,
    controller: Controller,
    mpc: Mpc | None,
    world: _lpvmpc.World,
    count: int,
    period: float,
    known: _Known,
    progress: bool,
) -> Run:
    from time import perf_counter

    inputs = names_of(plant.inputs)
    n, m, k = len(plant.states), len(inputs), len(plant.outputs)
    x, u, y = np.empty((count + 1, n)), np.empty((count, m)), np.empty((count, k))
    readings = np.empty((count, len(world.readings)))
    measured, step_times = np.empty((count, n)), np.empty(count)
    estimator = None if mpc is None else mpc.estimator
    found = {name: np.empty(count) for name in (estimator.disturbances if estimator else ())}
    plans: list[Plan] = []
    seen = world.x  # where a reading is missing, the last one holds
    x[0] = seen
    for i in samples_of(count, progress):
        readings[i] = [np.nan if reading is None else reading[0] for reading in world.readings]
        start = perf_counter()
        if mpc is not None and estimator is not None:
            mpc.observe(world.time, readings[i])
            estimate = mpc.estimate
            assert estimate is not None
            seen = estimate.x
            for name, one in estimate.disturbances.items():
                found[name][i] = one
        else:
            seen = np.where(np.isnan(readings[i]), seen, readings[i])
        measured[i] = seen
        if mpc is not None:
            ahead: dict[str, Any] = {place: one[i : i + mpc.horizon + 1] for place, one in known.ahead.items()}
            plan = mpc.step(seen, **ahead) if estimator is None else mpc.decide(**ahead)
            plans.append(plan)
            u[i] = plan.u0
        else:
            u[i] = column("controller", controller(i * period, seen.copy()), inputs)  # type: ignore[operator]
        step_times[i] = perf_counter() - start
        if not np.isfinite(u[i]).all():
            raise SimulationError(
                f"the controller's input {u[i].tolist()} at {i * period:g} s is not finite"
            )
        if k:
            y[i] = plant.g(x[i], u[i])
        world.command(u[i])
        try:
            world.advance()
        except SimulationError as error:
            raise SimulationError(f"after {i * period:g} s, sample {i}: {error}") from None
        x[i + 1] = world.x
    return Run(
        plant=plant,
        t=np.arange(count + 1, dtype=np.float64) * period,
        x=x,
        u=u,
        y=y,
        readings=readings,
        x_measured=measured,
        x_ref=known.reference,
        disturbances=found,
        plans=plans,
        step_times=step_times,
        bounds={} if mpc is None else mpc.bounds,
    )


def _reference(
    place: str,
    given: ArrayLike | Callable[[float], ArrayLike],
    of: list[str],
    stages: int,
    period: float,
    start: float = 0.0,
) -> Array:
    """The reference at so many samples from the time `start` on."""
    if callable(given):
        times = start + np.arange(stages) * period
        return np.array([column(f"{place} at {t:g} s", given(float(t)), of) for t in times])
    first = int(np.floor(start / period + 1e-9))
    array, n = numbers(place, ordered(place, given, of)), len(of)
    if array.shape == (n,) or (array.ndim == 0 and n == 1):
        return np.tile(array.reshape(1, n), (stages, 1))
    if array.ndim == 2 and array.shape[1] == n and len(array):
        held = np.repeat(array[-1:], max(0, first + stages - len(array)), axis=0)
        return np.concatenate([array, held])[first : first + stages]
    raise SettingError(
        f"{place}: its shape is {array.shape}; it must be ({n},), (samples, {n}) or a function of time"
    )
