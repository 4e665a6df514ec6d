"""What a simulated plant has beside its controller: sensors, actuators, loads and jumps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Kind, by_name, column, instance, number
from .errors import SettingError
from .estimator import Estimator
from .plant import Plant, Signal, names_of


@dataclass(frozen=True)
class Sensor:
    """A measured state or output, and what is wrong with the reading. All in its unit."""

    noise: float = 0.0
    """Standard deviation of white Gaussian noise."""
    bias: float = 0.0
    """Constant error that is added."""
    resolution: float = 0.0
    """Step between two readings; 0 for a continuous one."""
    dropout: float = 0.0
    """Probability that a sample is missing. A controller without an estimator then has the last one, and before the
    first one the true state."""


@dataclass(frozen=True)
class Actuator:
    """What becomes of a commanded input, in input units: limited, less the dead zone, with a lag."""

    limit: float = np.inf
    """Largest magnitude."""
    dead_zone: float = 0.0
    """Commands of this magnitude or less have no effect, larger ones lose it."""
    lag: float = 0.0
    """Time constant of a first-order lag, s."""


@dataclass(frozen=True)
class Load:
    """A constant load for a while: x_dot = f(x, u) + load."""

    start: float
    """From when on, s."""
    end: float
    """Until when, s; infinite for ever."""
    load: ArrayLike
    """In state units per second (per period, in discrete time), shape (n,)."""


@dataclass(frozen=True)
class Jump:
    """A jump of the state: a collision."""

    time: float
    """When, s. At 0 it acts just after the first reading."""
    change: ArrayLike
    """Added to the state, shape (n,)."""


def _of_signals(
    place: str, given: Mapping[str, Kind] | None, signals: list[Signal], kind: type[Kind]
) -> Mapping[str, Kind]:
    names = names_of(signals)
    one_each = by_name(place, {} if given is None else given, f"lpvmpc.{kind.__name__} by name")
    for name, one in one_each.items():
        if name not in names:
            raise SettingError(f"{place}: there is no {name!r}; there are {', '.join(names)}")
        instance(f"{place}, {name}", one, kind)
    return one_each


def sensors_of(
    given: Mapping[str, Sensor] | None, plant: Plant, estimator: Estimator | None
) -> list[tuple[Any, ...]] | None:
    states = plant.states
    measured = states
    if estimator is not None:
        known = {signal.name: signal for signal in (*plant.outputs, *states)}
        for name in estimator.measured:
            if name not in known:
                raise SettingError(f"plant: it has no {name!r}, which the controller measures")
        measured = [known[name] for name in estimator.measured]
    sensors = _of_signals("sensors", given, measured, Sensor)
    if not sensors and estimator is None:
        return None
    found = []
    for signal in measured:
        one = sensors.get(signal.name, Sensor())
        row = [1.0 if state.name == signal.name else 0.0 for state in states]
        of = row if any(row) else signal.name
        errors = [
            number(f"sensors, {signal.name}, {part}", getattr(one, part))
            for part in ("noise", "bias", "resolution", "dropout")
        ]
        found.append((of, *errors, 1, 0))
    return found


def actuators_of(
    given: Mapping[str, Actuator] | None, inputs: list[Signal]
) -> list[tuple[float, float, float]] | None:
    actuators = _of_signals("actuators", given, inputs, Actuator)
    if not actuators:
        return None
    each = [(signal.name, actuators.get(signal.name, Actuator())) for signal in inputs]
    return [
        (
            number(f"actuators, {name}, limit", one.limit),
            number(f"actuators, {name}, dead_zone", one.dead_zone),
            number(f"actuators, {name}, lag", one.lag),
        )
        for name, one in each
    ]


def push_of(i: int, push: Load | Jump, of: list[str]) -> tuple[Any, ...]:
    place = f"disturbances[{i}]"
    if isinstance(push, Load):
        begin, end = number(f"{place}, start", push.start), number(f"{place}, end", push.end)
        return begin, end, column(place, push.load, of).tolist()
    if isinstance(push, Jump):
        time = number(f"{place}, time", push.time)
        if not time >= 0:
            raise SettingError(f"{place}, time: it is {time} s; the run begins at 0 s")
        return time, column(place, push.change, of).tolist()
    raise SettingError(f"{place}: {push!r} is neither an lpvmpc.Load nor an lpvmpc.Jump")


def seed_of(given: Any) -> int:
    if isinstance(given, (int, np.integer)) and 0 <= given < 2**64:
        return int(given)
    raise SettingError(f"seed: it is {given!r}; it must be a whole number from 0 to 2^64 - 1")
