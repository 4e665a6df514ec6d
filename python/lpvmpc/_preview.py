"""What a step is told of the time ahead, as the native half takes it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arrays import by_stage, equally_long, listed, matrices_by_stage, numbers, weights_by_stage
from .constraints import bounds, row
from .errors import SettingError
from .plant import Plant, names_of

Array = NDArray[np.float64]

AHEAD = (
    "u_ref", "q", "r", "cross", "linear_x", "linear_u", "x_bounds", "u_bounds", "rows", "disturbance",
    "parameters", "y_ref", "q_y", "y_bounds", "r_du", "du_bounds", "matrices", "scheduling",
)  # fmt: skip
"""What a step may be told besides the reference."""


def check_names(ahead: Mapping[str, Any]) -> None:
    """Refuses what a step is not told by any of these names."""
    for name in ahead:
        if name not in AHEAD:
            raise SettingError(f"{name}: a step takes no such thing; there are {', '.join(AHEAD)}")


def to_native(
    plant: Plant, settings: Mapping[str, Any], x_ref: ArrayLike | None, ahead: Mapping[str, Any]
) -> dict[str, Any]:
    """What a step of a controller with these settings is told, of which what is None is left out."""
    of_x, of_u, of_y = names_of(plant.states), names_of(plant.inputs), names_of(plant.outputs)
    told = {"x_ref": x_ref, **ahead}
    given = {name: one for name, one in told.items() if one is not None}
    known: dict[str, Any] = {"x_ref": None}
    for name, of in (
        ("x_ref", of_x), ("u_ref", of_u), ("linear_x", of_x), ("linear_u", of_u), ("disturbance", of_x),
        ("parameters", list(plant.parameters)), ("y_ref", of_y),
    ):  # fmt: skip
        if name in given:
            known[name] = by_stage(name, given[name], of)
    if "scheduling" in given:
        size = (numbers("scheduling", given["scheduling"]).shape or (1,))[-1]
        known["scheduling"] = by_stage("scheduling", given["scheduling"], size)
    for name, of in (("q", of_x), ("r", of_u), ("q_y", of_y), ("r_du", of_u)):
        if name in given:
            known[name] = weights_by_stage(name, given[name], of)
    if "cross" in given:
        known["cross"] = matrices_by_stage("cross", given["cross"], of_u, of_x)
    if ("q" in given) != ("r" in given):
        raise SettingError("q, r: give both or neither")
    if "q" in given:
        known["q"], known["r"] = equally_long(known["q"], known["r"])
    for name in ("x", "u", "y", "du"):
        if f"{name}_bounds" in given:
            known |= bounds(plant, settings, name, given[f"{name}_bounds"])
    if "rows" in given:
        stages = listed("rows", given["rows"], "a list of lists of lpvmpc.Row, one for each stage")
        known["rows"] = [
            [row(plant, one) for one in listed("rows", stage, "lists, one for each stage")]
            for stage in stages
        ]
    if "matrices" in given:
        known |= _models(given["matrices"], of_x, of_u)
    return known


def _models(given: tuple[ArrayLike, ...], of_x: list[str], of_u: list[str]) -> dict[str, Array]:
    """(A, B) or (A, B, c) by stage."""
    if not isinstance(given, (tuple, list)) or len(given) not in (2, 3):
        raise SettingError("matrices: they must be (A, B) or (A, B, c)")
    parts = [
        matrices_by_stage("matrices, A", given[0], of_x, of_x),
        matrices_by_stage("matrices, B", given[1], of_x, of_u),
    ]
    if len(given) == 3:
        parts.append(by_stage("matrices, c", given[2], of_x))
    return dict(zip("abc", equally_long(*parts)))  # without c, if there is none
