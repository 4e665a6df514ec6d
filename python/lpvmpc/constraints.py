"""Bounds, prices and linear constraints of a controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arrays import by_stage, column, equally_long, instance, named, number
from .errors import SettingError
from .plant import Plant, Signal, names_of

Array = NDArray[np.float64]

Limits = Union[
    "tuple[ArrayLike | None, ArrayLike | None]", Mapping[str, "tuple[float | None, float | None]"]
]
"""Bounds: (lower, upper), each with a number for every state or input, or by name; None or an
infinite number where there is no bound, also for a whole side."""


@dataclass(frozen=True)
class Penalty:
    """The price of exceeding a bound by e: ``linear * e + quadratic * e**2 / 2``, in units of the cost."""

    linear: float = 0.0
    quadratic: float = 0.0


@dataclass(frozen=True)
class Row:
    """A linear constraint lower <= x'x_i + u'u_i <= upper at every stage: of states alone at stages 1 to N, with inputs
    at 0 to N - 1, since there is no input at the end.

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


def changes(plant: Plant) -> list[Signal]:
    """What the inputs are called where their changes are meant: these have no bounds of the plant."""
    return [Signal(one.name) for one in plant.inputs]


def _signals(plant: Plant, name: str) -> list[Signal]:
    """The states (x), inputs (u), outputs (y) or changes of inputs (du)."""
    return {"x": plant.states, "u": plant.inputs, "y": plant.outputs, "du": changes(plant)}[name]


def kept(
    plant: Plant, settings: Mapping[str, Any], name: str
) -> tuple[list[Signal], list[float], list[float]]:
    """The signals of this name with the bounds that a controller with these settings keeps to, lower and upper."""
    signals, place = _signals(plant, name), f"{name}_bounds"
    given = settings[place]
    return signals, *_sides(place, {} if given is None else given, signals)


def _names(place: str, given: Mapping[str, Any], signals: list[Signal]) -> list[str]:
    """The names of the signals, of which those that are given must be some."""
    names = names_of(signals)
    for name in given:
        if name not in names:
            raise SettingError(f"{place}: there is no {name!r}; there are {', '.join(names)}")
    return names


def _pair(place: str, given: Any) -> tuple[Any, Any]:
    try:
        lower, upper = given
    except (TypeError, ValueError):
        raise SettingError(f"{place}: it must be (lower, upper)") from None
    return lower, upper


def _open(given: Any, infinite: float) -> Any:
    """Bounds with an infinite one for None."""
    if isinstance(given, np.ndarray) and given.dtype == object:
        given = given.tolist()
    if isinstance(given, (list, tuple)):
        return [_open(one, infinite) for one in given]
    return infinite if given is None else given


def _both_open(pair: tuple[Any, Any], size: int) -> tuple[Any, Any]:
    """Lower and upper bounds of `size` signals, infinite ones for None, also for that of all."""
    lower, upper = ([None] * size if side is None else side for side in pair)
    return _open(lower, -np.inf), _open(upper, np.inf)


def limits(
    place: str, given: Limits | None, signals: list[Signal]
) -> tuple[list[float], list[float]] | None:
    """Bounds, one for each signal, as the native half takes them."""
    return None if given is None else _sides(place, given, signals)


def _sides(place: str, given: Limits, signals: list[Signal]) -> tuple[list[float], list[float]]:
    """The lower and the upper bounds; a signal that is not named has its own."""
    given = named(given)
    if isinstance(given, Mapping):
        _names(place, given, signals)
        pairs = [
            _pair(f"{place}, {signal.name}", given[signal.name])
            if signal.name in given
            else (signal.lower, signal.upper)
            for signal in signals
        ]
        sides: tuple[Any, Any] = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    else:
        sides = _pair(place, given)
    names = names_of(signals)
    lower, upper = _both_open(sides, len(names))
    return (
        column(f"{place}, lower", lower, names).tolist(),
        column(f"{place}, upper", upper, names).tolist(),
    )


def bounds(
    plant: Plant, settings: Mapping[str, Any], name: str, given: Limits
) -> dict[str, Array]:
    """Bounds by stage, or by name for all stages, as the native half takes them; what is not named has those of the
    settings."""
    place, names = f"{name}_bounds", names_of(_signals(plant, name))
    given = named(given)
    if isinstance(given, Mapping):
        usual = zip(*kept(plant, settings, name), strict=True)
        signals = [replace(one, lower=lower, upper=upper) for one, lower, upper in usual]
        given = _sides(place, given, signals)
    lower, upper = _both_open(_pair(place, given), len(names))
    lower, upper = equally_long(
        by_stage(f"{place}, lower", lower, names), by_stage(f"{place}, upper", upper, names)
    )
    return {f"{name}_lower": lower, f"{name}_upper": upper}


def _price(place: str, price: Any) -> tuple[float, float]:
    instance(place, price, Penalty)
    return number(place, price.linear), number(place, price.quadratic)


def prices(
    place: str, given: Mapping[str, Penalty], signals: list[Signal]
) -> list[tuple[float, float] | None]:
    """Prices by name, one for each signal, as the native half takes them."""
    names = _names(place, given, signals)
    return [_price(f"{place}, {name}", given[name]) if name in given else None for name in names]


def row(plant: Plant, given: Row) -> tuple[Any, ...]:
    """A row as the native half takes it."""
    instance("rows", given, Row)
    place = f"rows, {given.name}"
    of_x = _coefficients(f"{place}, x", given.x, plant.states)
    of_u = _coefficients(f"{place}, u", given.u, plant.inputs)
    if not any(of_x + of_u):
        raise SettingError(f"{place}: it has no coefficient, of a state (x) or of an input (u)")
    if given.lower is None and given.upper is None:
        raise SettingError(f"{place}: it has neither a lower nor an upper bound")
    return (
        str(given.name),
        of_x,
        of_u,
        -np.inf if given.lower is None else number(f"{place}, lower", given.lower),
        np.inf if given.upper is None else number(f"{place}, upper", given.upper),
        None if given.soft is None else _price(f"{place}, soft", given.soft),
    )


def _coefficients(place: str, given: Any, signals: list[Signal]) -> list[float]:
    if given is None:
        return [0.0] * len(signals)
    given = named(given)
    if isinstance(given, Mapping):
        names = _names(place, given, signals)
        return [number(place, given.get(name, 0.0)) for name in names]
    found: list[float] = column(place, given, names_of(signals)).tolist()
    return found
