"""Figures of runs with matplotlib, as the program draws them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .._plot import new_figure, span
from ..errors import ScenarioError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .run import PlaneRun, Run

Array = NDArray[np.float64]

# Of Okabe and Ito's palette, which colour-blind readers can tell apart.
_BLUE, _ORANGE, _GREEN, _VERMILION, _PINK = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7"
_DARK, _GREY, _LIGHT = "#333333", "#7f7f7f", "#e5e5e5"
_STATES = ("φ [rad]", "θ [rad]", "$\\dot{\\varphi}$ [rad/s]", "$\\dot{\\theta}$ [rad/s]")
_STATE_NAMES = ("phi", "theta", "phi_dot", "theta_dot")
_TORQUE = "τ [N m]"
_TIME = "t [s]"

# As much of a run is its beginning; it gets panels of its own where it needs more than so many times the scale of
# the rest.
_BEGINNING, _DOMINATES = 0.02, 2.0
# What a descent leaves at its tolerance, rad and rad/s.
_NO_GAP = 1e-4

_Draw = Callable[["Axes"], None]


def run(run: Run, figure: Figure | None) -> Figure:
    """States, torque and cost over time."""
    if len(run.planes) == 1:
        plane = run.planes[0]
        panels = [*(_state(run, i) for i in range(4)), _torque(run), _cost(plane)]
        figure = new_figure(figure, (9.0, 8.0))
        axes = list(figure.subplots(3, 2, sharex=True).ravel())
        for panel, draw in zip(axes, panels, strict=True):
            draw(panel)
        for panel in axes:
            panel.tick_params(labelbottom=True)
        return _finished(figure, run.title, axes, axes[-2:], run.t)
    panels = [_state(run, 0), _error(run), *(_state(run, i) for i in (1, 2, 3)), _torque(run)]
    return _with_beginning(run, panels, figure, 2.05)


def path(run: Run, figure: Figure | None) -> Figure:
    """The way on the floor, with its reference."""
    figure = new_figure(figure, (6.4, 6.6))
    panel = figure.subplots()
    x, y = (run.metres_per_rad * run.state[:, i, 0] for i in range(2))
    panel.plot(x, y, color=_BLUE, lw=1.4, label="ballbot")
    x_ref, y_ref = (run.metres_per_rad * run.reference[:, i, 0] for i in range(2))
    panel.plot(x_ref, y_ref, color=_DARK, lw=1.2, ls=(0, (6, 5)), label="reference")
    panel.plot(x[:1], y[:1], "ko", ms=5, ls="none", label="start")
    panel.set_aspect("equal", adjustable="datalim")
    panel.set_xlabel("x [m]")
    panel.set_ylabel("y [m]")
    _style(panel)
    _titled(figure, run.title, [panel])
    return figure


def motors(run: Run, figure: Figure | None) -> Figure:
    """The three motors' torques."""
    found = run.motors
    if found is None:
        raise ScenarioError("a run of one plane has no motors")
    t, torque = found.t, found.torque
    limits = (-found.limit, found.limit) if found.limit is not None else (-np.inf, np.inf)

    def draw(panel: Axes) -> None:
        for i, color in enumerate((_PINK, _GREEN, _ORANGE)):
            panel.step(t, torque[:, i], where="post", color=color, lw=1.2, label=f"motor {i + 1}")
        panel.set_ylabel(_TORQUE)
        _shade(panel, limits)

    return _with_beginning(run, [draw], figure, 3.4, "Motor torques")


def plans(run: Run, figure: Figure | None) -> Figure:
    """How far the plans were from the model, and what backed each torque."""
    panels: list[_Draw] = []
    for plane in run.planes:
        # Negated, so that a gap that is NaN is shown, too.
        if not (np.abs(plane.gap) <= _NO_GAP).all():
            panels.append(_gap(plane))
        if plane.decision:
            panels += [_set_points(plane), _decisions(plane)]
    if not panels:
        raise ScenarioError(
            "kind = 'plans': the plans are rollouts of the model, and there is no guarantee to be shown"
        )
    figure = new_figure(figure, (9.0, 0.8 + 2.6 * len(panels)))
    axes = list(figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0])
    for panel, draw in zip(axes, panels, strict=True):
        draw(panel)
        if panel.get_legend_handles_labels()[0]:
            panel.legend(
                loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0.1, frameon=False, fontsize="small", ncols=4
            )
    return _finished(figure, run.title, axes, axes[-1:], run.t, legend=False)


def _curves(run: Run) -> list[tuple[PlaneRun, str, str]]:
    """The planes with their names in the legend, and their colours."""
    if len(run.planes) == 1:
        return [(run.planes[0], "ballbot", _BLUE)]
    return [(plane, f"{plane.name} plane", color)
            for plane, color in zip(run.planes, (_BLUE, _ORANGE), strict=True)]  # fmt: skip


def _state(run: Run, index: int) -> _Draw:
    def draw(panel: Axes) -> None:
        for plane, label, color in _curves(run):
            panel.plot(plane.t, plane.state[:, index], color=color, lw=1.4, label=label)
        for plane in run.planes if index == 0 else ():
            how: Any = panel.step if plane.reference_is_held else panel.plot
            where = {"where": "post"} if plane.reference_is_held else {}
            how(plane.t, plane.reference[:, 0], color=_DARK, lw=1.2, ls="--", label="reference", **where)
        panel.set_ylabel(_STATES[index])
        _shade(panel, run.bounds[_STATE_NAMES[index]])

    return draw


def _error(run: Run) -> _Draw:
    def draw(panel: Axes) -> None:
        for plane, label, color in _curves(run):
            error = plane.state[:, 0] - plane.reference[:, 0]
            panel.plot(plane.t, error, color=color, lw=1.4, label=label)
        panel.set_ylabel("error of φ [rad]")

    return draw


def _torque(run: Run) -> _Draw:
    def draw(panel: Axes) -> None:
        for plane, label, color in _curves(run):
            held = np.append(plane.input, plane.input[-1:])
            panel.step(plane.t[: len(held)], held, where="post", color=color, lw=1.4, label=label)
        panel.set_ylabel(_TORQUE)
        _shade(panel, run.bounds["torque"])

    return draw


def _cost(plane: PlaneRun) -> _Draw:
    def draw(panel: Axes) -> None:
        panel.plot(plane.t[: len(plane.cost)], plane.cost, color=_BLUE, lw=1.4)
        panel.set_ylabel("cost J [–]")

    return draw


def _gap(plane: PlaneRun) -> _Draw:
    def draw(panel: Axes) -> None:
        sizes = np.maximum(np.abs(plane.gap), np.finfo(float).eps)
        colors = (_BLUE, _VERMILION, _GREEN, _PINK)
        for i, (label, color) in enumerate(zip(_STATES, colors, strict=True)):
            panel.semilogy(plane.t[: len(sizes)], sizes[:, i], color=color, lw=1.2, label=label)
        of = f" ({plane.name} plane)" if plane.name else ""
        panel.set_ylabel(f"|rollout – prediction|\nat the end{of}")

    return draw


def _set_points(plane: PlaneRun) -> _Draw:
    def draw(panel: Axes) -> None:
        t = plane.t[: len(plane.set_point)]
        panel.step(t, plane.set_point, where="post", color=_GREEN, lw=1.4, label="artificial")
        panel.step(
            t, plane.reference[: len(t), 0], where="post", color=_DARK, lw=1.2, ls="--", label="reference"
        )
        panel.set_ylabel("set point [rad]")

    return draw


def _decisions(plane: PlaneRun) -> _Draw:
    def draw(panel: Axes) -> None:
        order = [one for one in _DECISIONS if one in plane.decision]
        place = [order.index(one) for one in plane.decision]
        panel.plot(plane.t[: len(place)], place, ".", color=_BLUE, ms=4)
        panel.set_yticks(range(len(order)), order)
        panel.set_ylim(-0.5, len(order) - 0.5)
        panel.set_ylabel("backed by")

    return draw


# From the weakest to the strongest.
_DECISIONS = ("saturated LQR", "soft bounds", "terminal law", "candidate", "new plan")


def _with_beginning(
    run: Run, panels: Sequence[_Draw], figure: Figure | None, height: float, title: str | None = None
) -> Figure:
    """Panels one below the other; where the beginning dominates the scale of one, it stands in a column of its own."""
    t = run.t
    begun = t[0] + _BEGINNING * (t[-1] - t[0])
    figure = new_figure(figure, (9.0, 0.9 + height * len(panels)))
    axes = figure.subplots(len(panels), 2, squeeze=False)
    after = []
    dominates = False
    for pair, draw in zip(axes, panels, strict=True):
        for panel in pair:
            draw(panel)
        lines = [line for line in pair[1].lines if np.size(line.get_xdata()) > 2]
        values = [(np.asarray(one.get_xdata()), np.asarray(one.get_ydata())) for one in lines]
        whole = span([y for _, y in values])
        later = span([y[x >= begun] for x, y in values])
        after.append(later)
        dominates |= whole[1] - whole[0] > _DOMINATES * (later[1] - later[0])
    if dominates:
        axes[0, 0].set_title("the beginning", fontsize="medium")
        axes[0, 1].set_title("the whole run, at the scale of what follows", fontsize="medium")
        for (first, whole_run), (low, high) in zip(axes, after, strict=True):
            first.set_xlim(t[0], begun)
            room = 0.06 * max(high - low, 1e-12)
            whole_run.set_ylim(low - room, high + room)
            _rescale(first, begun)
        shown = axes
    else:
        for panel in axes[:, 0]:
            panel.remove()
        grid = figure.add_gridspec(len(panels), 1)
        for i, panel in enumerate(axes[:, 1]):
            panel.set_subplotspec(grid[i, 0])
        shown = axes[:, 1:]
    for panel in shown[:, -1]:
        panel.set_xlim(t[0], t[-1])
    return _finished(figure, title or run.title, list(shown.ravel()), list(shown[-1]), None)


def _rescale(panel: Axes, end: float) -> None:
    """To what is drawn until `end`."""
    lines = [line for line in panel.lines if np.size(line.get_xdata()) > 2]
    low, high = span(
        [np.asarray(one.get_ydata())[np.asarray(one.get_xdata()) <= end] for one in lines]
    )
    room = 0.06 * max(high - low, 1e-12)
    panel.set_ylim(low - room, high + room)


def _shade(panel: Axes, bounds: tuple[float, float]) -> None:
    """Shades what is beyond bounds that the curves come near to."""
    low, high = span([np.asarray(line.get_ydata(), dtype=np.float64) for line in panel.lines])
    height = max(high - low, 1e-12)
    bottom, top = low - 0.06 * height, high + 0.06 * height
    lower, upper = bounds
    label: str | None = "outside the bounds"
    shade: dict[str, Any] = {"color": _GREY, "alpha": 0.28, "lw": 0}
    far = 100 * height
    if low - lower < 0.6 * height:
        bottom = min(bottom, lower - 0.05 * height)
        panel.axhspan(lower - far, lower, label=label, **shade)
        panel.axhline(lower, color=_GREY, lw=0.9)
        label = None
    if upper - high < 0.6 * height:
        top = max(top, upper + 0.05 * height)
        panel.axhspan(upper, upper + far, label=label, **shade)
        panel.axhline(upper, color=_GREY, lw=0.9)
    panel.set_ylim(bottom, top)


def _style(panel: Axes) -> None:
    panel.grid(True, color=_LIGHT, lw=0.7)
    panel.set_axisbelow(True)


def _finished(
    figure: Figure,
    title: str,
    panels: Sequence[Axes],
    lowest: Sequence[Axes],
    t: Array | None,
    legend: bool = True,
) -> Figure:
    for letter, panel in zip("abcdefghijklmnop", panels, strict=False):
        _style(panel)
        if t is not None:
            panel.set_xlim(t[0], t[-1])
        if len(panels) > 1:
            panel.text(
                -0.02, 1.04, f"({letter})", transform=panel.transAxes, ha="right", va="bottom", fontsize="small"
            )
    for panel in lowest:
        panel.set_xlabel(_TIME)
    figure.align_ylabels(list(panels))
    _titled(figure, title, panels if legend else [])
    return figure


def _titled(figure: Figure, title: str, panels: Sequence[Axes]) -> None:
    """A title, and below it one legend of all panels."""
    found: dict[str, Any] = {}
    for panel in panels:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    if not found:
        figure.suptitle(title, fontsize="large")
        return
    # As one: a title of the figure would be drawn over a legend that is outside the panels.
    figure.legend(
        list(found.values()), list(found), title=title, title_fontsize="large",
        loc="outside upper center", ncols=len(found), frameon=False,
    )  # fmt: skip
