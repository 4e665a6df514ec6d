"""Figures with matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .errors import MissingPackageError, SettingError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .simulation import Run

Array = NDArray[np.float64]

# Of Okabe and Ito's palette, which colour-blind readers can tell apart.
_BLUE, _VERMILION, _GREY = "#0072B2", "#D55E00", "#7f7f7f"


def new_figure(figure: Figure | None, size: tuple[float, float]) -> Figure:
    """The figure to draw in: a new one of this size, in inches, where none is given."""
    if figure is not None:
        return figure
    try:
        from matplotlib.figure import Figure as NewFigure
    except ImportError as error:
        raise MissingPackageError(
            "this needs matplotlib: pip install matplotlib, or pip install lpvmpc[plot]"
        ) from error
    try:
        from matplotlib import pyplot

        return pyplot.figure(figsize=size, layout="constrained")
    except ImportError:
        return NewFigure(figsize=size, layout="constrained")


def plot_run(run: Run, signals: Sequence[str] | None, figure: Figure | None) -> Figure:
    """Each state, input and output over time."""
    names = list(run._names() if signals is None else signals)
    for name in names:
        if name not in run._names():
            raise SettingError(f"signals: there is no {name!r}; there are {', '.join(run._names())}")
    if not names:
        raise SettingError("signals: there are none to be shown")
    figure = new_figure(figure, (7.0, 1.0 + 1.35 * len(names)))
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for panel, name in zip(panels, names, strict=True):
        _draw(panel, run, name)
    panels[-1].set_xlabel("time [s]")
    panels[-1].set_xlim(run.t[0], run.t[-1])
    figure.align_ylabels(list(panels))
    return figure


def _draw(panel: Axes, run: Run, name: str) -> None:
    states = [one.name for one in run.plant.states]
    inputs = [one.name for one in run.plant.inputs]
    signals = [*run.plant.states, *run.plant.inputs, *run.plant.outputs]
    unit = next(one.unit for one in signals if one.name == name)
    values = run[name]
    shown = [values]
    if name in states and run.x_ref is not None:
        reference = run.x_ref[:, states.index(name)]
        shown.append(reference)
        panel.step(
            run.t[: len(reference)], reference, where="post", color=_VERMILION, lw=1.1, ls="--",
            label="reference",
        )  # fmt: skip
    if name in inputs:
        held = np.append(values, values[-1:])
        panel.step(run.t, held, where="post", color=_BLUE, lw=1.4)
    else:
        panel.plot(run.t[: len(values)], values, color=_BLUE, lw=1.4)
    low, high = span(shown)
    lower, upper = run.bounds.get(name, (-np.inf, np.inf))
    _shade(panel, low, high, lower, upper)
    label = name.replace("_", " ")
    panel.set_ylabel(f"{label}\n[{unit}]" if unit else label)
    panel.grid(True, color="#e5e5e5", lw=0.6)
    panel.spines[["top", "right"]].set_visible(False)
    if len(shown) > 1:
        panel.legend(loc="best", frameon=False, fontsize="small")


def span(parts: Sequence[Array]) -> tuple[float, float]:
    """The least and the largest of what is finite; zero where nothing is."""
    values = np.concatenate([np.zeros(0), *(np.ravel(part) for part in parts)])
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)


def _shade(panel: Axes, low: float, high: float, lower: float, upper: float) -> None:
    """Shades what lies beyond bounds that the curve comes near to."""
    height = max(high - low, 1e-3 * max(abs(low), abs(high)), 1e-12)
    near = 0.5 * height
    bottom, top = low - 0.08 * height, high + 0.08 * height
    if np.isfinite(lower) and low - lower < near:
        bottom = min(bottom, lower - 0.12 * height)
        panel.axhspan(bottom - 10 * height, lower, color=_GREY, alpha=0.25, lw=0)
        panel.axhline(lower, color=_GREY, lw=0.8)
    if np.isfinite(upper) and upper - high < near:
        top = max(top, upper + 0.12 * height)
        panel.axhspan(upper, top + 10 * height, color=_GREY, alpha=0.25, lw=0)
        panel.axhline(upper, color=_GREY, lw=0.8)
    panel.set_ylim(bottom, top)
