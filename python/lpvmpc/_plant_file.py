"""A plant as its file describes it: formulas, and the names, units, bounds and values that belong to them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import column, named, number, ordered
from ._tape import Tape
from .errors import PlantError


def text(
    tape: Tape,
    *,
    derivative: list[int],
    output: list[int],
    name: str,
    states: Sequence[str],
    inputs: Sequence[str],
    outputs: Sequence[str] | None,
    parameters: Mapping[str, float],
    units: Mapping[str, str] | None,
    bounds: Mapping[str, tuple[float | None, float | None]] | None,
    equilibrium: tuple[ArrayLike, ArrayLike] | None,
    period: float | None,
    embedding: dict[str, Any] | None = None,
) -> str:
    """The text of a plant's file, as `lpvmpc.Plant.from_json` reads it."""
    called = names("outputs", outputs, [f"y_{i}" for i in range(len(output))])
    units, bounds = dict(units or {}), dict(bounds or {})
    known = [*states, *inputs, *called, *parameters]
    for place, given in (("units", units), ("bounds", bounds)):
        for unknown in given:
            if unknown not in known:
                raise PlantError(f"{place}: there is no {unknown!r}; there are {', '.join(known)}")
    for bounded in bounds:
        if bounded in parameters:
            raise PlantError(f"bounds: {bounded!r} is a parameter, and has none")

    def signal(one: str) -> dict[str, Any]:
        entry: dict[str, Any] = {"name": str(one), "unit": str(units.get(one, ""))}
        try:
            lower, upper = bounds.get(one, (None, None))
        except (TypeError, ValueError):
            raise PlantError(
                f"bounds: of {one} they are {bounds[one]!r}; they must be (lower, upper)"
            ) from None
        for key, given in (("lower", lower), ("upper", upper)):
            if given is None:
                continue
            limit = number(f"bounds, {one}, {key}", given, PlantError)
            if np.isfinite(limit):
                entry[key] = limit
            elif limit != (-np.inf if key == "lower" else np.inf):
                raise PlantError(f"bounds: the {key} one of {one} is {'NaN' if np.isnan(limit) else limit}")
        return entry

    data: dict[str, Any] = {
        "schema": 1,
        "name": name,
        "states": [signal(one) for one in states],
        "inputs": [signal(one) for one in inputs],
        "parameters": [
            {"name": one, "unit": str(units.get(one, "")), "value": float(value)}
            for one, value in parameters.items()
        ],
        "outputs": [signal(one) for one in called],
        "operations": tape.operations,
    }
    if period is None:
        data["derivative"] = derivative
    else:
        seconds = number("period", period, PlantError)
        if not (np.isfinite(seconds) and seconds > 0):
            raise PlantError(f"period: it is {seconds} s; it must be a positive number of seconds")
        data |= {"period": seconds, "next": derivative}
    if output:
        data["output"] = output
    if equilibrium is not None:
        try:
            x, u = equilibrium
        except (TypeError, ValueError):
            raise PlantError(f"equilibrium: it is {equilibrium!r}; it must be (x, u)") from None
        data["equilibrium"] = {
            "x": _finite("equilibrium, x", x, states), "u": _finite("equilibrium, u", u, inputs)
        }  # fmt: skip
    if embedding is not None:
        data["embedding"] = embedding
    try:
        return json.dumps(data, allow_nan=False)
    except ValueError:
        raise PlantError(
            "formulas: they contain a number that is not finite (a division by zero, an overflow)"
        ) from None


def _finite(place: str, given: ArrayLike, of: Sequence[str]) -> list[float]:
    found: list[float] = column(place, given, of, PlantError).tolist()
    for name, value in zip(of, found, strict=True):
        if not np.isfinite(value):
            raise PlantError(f"{place}: {name} is {value}; it must be finite")
    return found


def names(place: str, given: Sequence[str] | None, usual: list[str]) -> list[str]:
    """The names that are `given`, or else the `usual` ones."""
    if given is None:
        return usual
    if isinstance(given, str) or len(given) != len(usual):
        raise PlantError(f"{place}: {given!r} are not {len(usual)} names")
    return [str(one) for one in given]


def values(
    given: Mapping[str, float] | Sequence[float] | None, names: list[str]
) -> dict[str, float]:
    """The values of the parameters by name. The keys of a mapping are the `names`, or other ones in their order."""
    given = named(given)
    called = list(names)
    try:
        values = list(() if given is None else ordered("parameters", given, names, PlantError))
    except TypeError:
        raise PlantError(f"parameters: it is {given!r}; it must be a list, or values by name") from None
    if isinstance(given, Mapping):
        called, values = [str(one) for one in given], list(given.values())
    if len(values) != len(names):
        raise PlantError(
            f"parameters: there are values for {len(values)}, and p has {len(names)} "
            f"({', '.join(names)})"
        )
    found = {
        name: number(f"parameters, {name}", value, PlantError)
        for name, value in zip(called, values, strict=True)
    }
    for name, value in found.items():
        if not np.isfinite(value):
            raise PlantError(f"parameters, {name}: it is {value}; it must be finite")
    strange = [name for name in found if name not in names]
    if not strange:
        return {name: found[name] for name in names}
    if len(strange) < len(names):
        # By name or by order? Either may be meant.
        raise PlantError(
            f"parameters: p has {', '.join(names)}, and no {', '.join(strange)}; give all values by these names, or "
            "all by other ones in the order of p"
        )
    return found


def by_label(
    given: Mapping[str, float] | Sequence[float] | None, labels: list[str]
) -> Mapping[str, float]:
    """The values of the parameters that are called `labels`, in that order."""
    given = named(given)
    if not isinstance(given, Mapping):
        return values(given, labels)
    if set(given) != set(labels):
        raise PlantError(
            f"parameters: there are values for {', '.join(given) or 'none'}; the model has "
            f"{', '.join(labels) or 'none'}"
        )
    return {label: given[label] for label in labels}
