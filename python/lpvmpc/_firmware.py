"""A controller as a program for a microcontroller."""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arrays import column, weight
from .certificate import Certificate
from .design import lqr
from .errors import SettingError
from .plant import Plant

if TYPE_CHECKING:
    from .mpc import Mpc

USUAL: dict[str, Any] = {
    "state_bounds": "soft", "u_ref": None, "rows": (), "q_y": None, "y_bounds": None, "r_du": None,
    "du_bounds": None, "linear_models": "own", "substeps": 1, "method": "descent", "max_programs": 8,
    "tolerance": 1e-5, "estimator": None,
}  # fmt: skip
"""What the program has no other value for."""


def save_firmware(
    mpc: Mpc,
    folder: str | PathLike[str],
    lpvmpc: str | PathLike[str],
    x0: ArrayLike,
    x_ref: ArrayLike | None,
    samples: int,
) -> None:
    settings, plant = mpc.settings, mpc.plant
    for name, usual in USUAL.items():
        if not isinstance(settings[name], type(usual)) or settings[name] != usual:
            raise SettingError(
                f"{name}: it is {settings[name]!r}; on a microcontroller it must be {usual!r}"
            )
    bounded = [one.name for one in plant.outputs if one.lower is not None or one.upper is not None]
    if bounded:
        raise SettingError(f"plant: it has bounds of {', '.join(bounded)}; a program keeps none of outputs")
    n, m = len(plant.states), len(plant.inputs)
    rest = np.zeros(n) if plant.equilibrium is None else plant.equilibrium[0]
    _with_bounds(plant, mpc.bounds)._native.save_firmware(
        Path(folder),
        str(lpvmpc),
        mpc.t_s,
        mpc.horizon,
        _diagonal("q", settings["q"], n),
        _diagonal("r", settings["r"], m),
        _terminal(mpc).tolist(),
        (rest if x_ref is None else column("x_ref", x_ref, n)).tolist(),
        column("x0", x0, n).tolist(),
        samples,
    )


def _diagonal(place: str, given: ArrayLike, size: int) -> list[float]:
    whole = weight(place, given, size)
    if (whole != np.diag(np.diag(whole))).any():
        raise SettingError(f"{place}: it must be diagonal on a microcontroller")
    found: list[float] = np.diag(whole).tolist()
    return found


def _terminal(mpc: Mpc) -> NDArray[np.float64]:
    """The terminal cost P."""
    settings, plant = mpc.settings, mpc.plant
    terminal = settings["terminal"]
    if isinstance(terminal, Certificate):
        raise SettingError("terminal: the program has no guaranteed loop; give certificate.p, its cost")
    if not isinstance(terminal, str):
        return weight("terminal", terminal, len(plant.states))
    if terminal == "lqr":
        return lqr(plant, mpc.t_s, settings["q"], settings["r"]).p
    raise SettingError(f"terminal: it is {terminal!r}; on a microcontroller it must be a cost")


def _with_bounds(plant: Plant, bounds: dict[str, tuple[float, float]]) -> Plant:
    """The plant with its present parameters and these bounds."""
    data = json.loads(plant.to_json())
    for signal in (*data["states"], *data["inputs"]):
        for key, limit in zip(("lower", "upper"), bounds[signal["name"]], strict=True):
            signal.pop(key, None)
            if np.isfinite(limit):
                signal[key] = limit
    return Plant.from_json(json.dumps(data)).with_parameters(**plant.parameters)
