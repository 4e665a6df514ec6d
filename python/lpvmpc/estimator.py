"""What is known of a plant's state from what is measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arrays import by_name, column, instance, named, number, ordered
from .errors import SettingError
from .plant import Plant, Signal, names_of


@dataclass(frozen=True)
class Disturbance:
    """What acts on a plant besides its inputs, constant or slow, and is found from the readings."""

    noise: float
    """The variance that it gains per second: how fast it may wander."""
    initial: float = 1.0
    """Its variance about zero at the start."""


@dataclass(frozen=True)
class Gate:
    """Which readings are not believed."""

    deviations: float = np.inf
    """A reading farther from the prediction than so many standard deviations is an outlier, and not used. Without a
    number those are that are farther than 4.5e15 of them, three in a row at most: they would leave nothing of the
    estimate but rounding."""
    patience: int = 0
    """So many outliers in a row are not used; the next one is believed."""
    oldest: float = np.inf
    """A reading older than this, s, is not used."""
    longest_gap: float = np.inf
    """After so many seconds without a reading there is no estimate."""


@dataclass(frozen=True)
class Estimator:
    """An extended Kalman filter for state and disturbances, and the delay of the inputs.

    All noises are variances: squares of standard deviations. The filter predicts with the controller's own
    nonlinear model, through the delay, so that the plan begins where its first input will act.
    """

    measured: Mapping[str, float]
    """What is measured, states or outputs that do not depend on the input, with the variance of each reading:
    ``{"position": 1e-6}``. Their order is that of the readings."""
    state_noise: ArrayLike | Mapping[str, float]
    """The variance that each state gains per second, for what the model does not know: shape (n,), or by name;
    those that are not named gain none."""
    disturbances: Mapping[str, Disturbance] = field(default_factory=dict)
    """Disturbances to be found, by the name of the input beside which one acts, or of the state to whose derivative
    (next value, in discrete time) it adds. With one for each output that is to be tracked there is no offset.
    There may be no more than readings."""
    delay: float = 0.0
    """The time from a measurement to the input that answers it, s."""
    start: ArrayLike | None = None
    """Where the plant is believed to be before the first reading, (n,); at its equilibrium, or zero, without."""
    initial_state: ArrayLike | Mapping[str, float] = 1.0
    """The variance of each state about `start`: one number, (n,), or by name; those that are not named have
    1."""
    gate: Gate = Gate()
    """Which readings are not believed; all are, as a rule."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a filter knows at the last readings."""

    x: NDArray[np.float64]
    """The state, shape (n,)."""
    disturbances: dict[str, float]
    """The disturbances, by name."""


def to_native(plant: Plant, given: Estimator) -> dict[str, Any]:
    """An estimator as the native half takes it."""
    instance("estimator", given, Estimator)
    states = plant.states
    place = "estimator"
    measured = by_name(f"{place}, measured", given.measured, "variances by name")
    disturbances = by_name(f"{place}, disturbances", given.disturbances, "lpvmpc.Disturbance by name")
    for name, one in disturbances.items():
        instance(f"{place}, disturbances, {name}", one, Disturbance)
    gate = instance(f"{place}, gate", given.gate, Gate)
    if isinstance(gate.patience, bool) or not isinstance(gate.patience, int) or gate.patience < 0:
        raise SettingError(f"{place}, gate, patience: {gate.patience!r} is no whole number from 0 on")
    return {
        "measured": list(measured),
        "measurement_noise": [
            number(f"{place}, measured, {name}", one) for name, one in measured.items()
        ],
        "state_noise": _by_state(f"{place}, state_noise", given.state_noise, states, 0.0),
        "start": None
        if given.start is None
        else column(f"{place}, start", given.start, names_of(states)).tolist(),
        "initial_state": _by_state(f"{place}, initial_state", given.initial_state, states, 1.0),
        "disturbances": [
            (
                name,
                number(f"{place}, disturbances, {name}, noise", one.noise),
                number(f"{place}, disturbances, {name}, initial", one.initial),
            )
            for name, one in disturbances.items()
        ],
        "delay": number(f"{place}, delay", given.delay),
        "gate": (
            number(f"{place}, gate, deviations", gate.deviations),
            gate.patience,
            number(f"{place}, gate, oldest", gate.oldest),
            number(f"{place}, gate, longest_gap", gate.longest_gap),
        ),
    }


def readings_to_native(
    names: Sequence[str], readings: Mapping[str, float | None] | ArrayLike
) -> list[float | None]:
    """Readings, by the names of what is measured or in their order, as the native half takes them: None where one is
    missing."""
    readings = named(readings)
    if isinstance(readings, Mapping):
        for name in readings:
            if name not in names:
                raise SettingError(f"readings: {name!r} is not measured; what is, is {', '.join(names)}")
        given = [readings.get(name) for name in names]
    else:
        known = ordered("readings", readings, names)
        given = np.atleast_1d(np.ma.asarray(known, dtype=object)).tolist()  # None where masked
    values = [None if one is None or np.ma.is_masked(one) else number("readings", one) for one in given]
    return [None if one is None or np.isnan(one) else one for one in values]


def _by_state(
    place: str, given: ArrayLike | Mapping[str, float], states: list[Signal], usual: float
) -> list[float]:
    names, given = names_of(states), named(given)
    if isinstance(given, Mapping):
        for name in given:
            if name not in names:
                raise SettingError(f"{place}: there is no {name!r}; there are {', '.join(names)}")
        return [number(f"{place}, {name}", given.get(name, usual)) for name in names]
    if not isinstance(given, Sequence) and np.ndim(given) == 0:
        return [number(place, given)] * len(names)
    found: list[float] = column(place, given, names).tolist()
    return found
