"""The settings of a controller, as the native half takes them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ._arrays import column, listed, number, weight, whole
from .certificate import Certificate
from .constraints import changes, limits, prices, row
from .design import lqr
from .errors import SettingError
from .plant import Plant, names_of


def designed(plant: Plant, given: Mapping[str, Any]) -> dict[str, Any]:
    """Settings whose terminal cost, where it is to be designed, is that for these parameters of the plant."""
    if isinstance(given["terminal"], str) and given["terminal"] == "lqr":
        return {**given, "terminal": lqr(plant, given["t_s"], given["q"], given["r"]).p}
    return dict(given)


def to_native(plant: Plant, given: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as the native half takes them."""
    states, inputs = plant.states, plant.inputs
    of_x, of_u = names_of(states), names_of(inputs)
    settings = dict(given)
    for name, most in (
        ("horizon", 1000), ("nodes", 16), ("substeps", 10_000), ("max_programs", 65_535), ("first_programs", 65_535),
    ):  # fmt: skip
        settings[name] = whole(name, given[name], most=most)
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
    settings["q"], settings["r"] = weight("q", given["q"], of_x), weight("r", given["r"], of_u)
    if isinstance(given["terminal"], Certificate):
        settings["terminal"] = (given["terminal"].to_json(),)
    elif not isinstance(given["terminal"], str):
        settings["terminal"] = weight("terminal", given["terminal"], of_x)
    settings["x_bounds"] = limits("x_bounds", given["x_bounds"], states)
    settings["u_bounds"] = limits("u_bounds", given["u_bounds"], inputs)
    if isinstance(given["state_bounds"], Mapping):
        settings["state_bounds"] = prices("state_bounds", given["state_bounds"], states)
    if given["u_ref"] is not None:
        settings["u_ref"] = column("u_ref", given["u_ref"], of_u)
    outputs = plant.outputs
    for name, of in (("q_y", names_of(outputs)), ("r_du", of_u)):
        if given[name] is not None:
            settings[name] = weight(name, given[name], of)
    settings["y_bounds"] = limits("y_bounds", given["y_bounds"], outputs)
    settings["du_bounds"] = limits("du_bounds", given["du_bounds"], changes(plant))
    if isinstance(given["output_bounds"], Mapping):
        settings["output_bounds"] = prices("output_bounds", given["output_bounds"], outputs)
    settings["rows"] = [row(plant, one) for one in listed("rows", given["rows"], "a list of lpvmpc.Row")]
    del settings["estimator"]
    return settings
