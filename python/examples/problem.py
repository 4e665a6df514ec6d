"""What a plant of the gallery consists of, and its optimal control problem in numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import lpvmpc
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Start:
    """A closed loop: from where, to where, for how long."""

    name: str
    x0: ArrayLike
    duration: float
    """s, or the plant's unit of time."""
    x_ref: Any = None
    """As of `lpvmpc.simulate`."""
    u_ref: ArrayLike | None = None
    """The input that costs nothing; without, the one that holds the end of the reference."""
    x_bounds: tuple[Array, Array] | None = None
    """Bounds by sample, (samples, n) each, whose last row holds from its end; without, the controller's."""


@dataclass(frozen=True)
class Example:
    """A plant with its controller and its closed loops. The first start is the one that is shown."""

    name: str
    title: str
    x: Any
    """States, inputs and derivatives in CasADi, from which IPOPT and do-mpc have the plant."""
    u: Any
    xdot: Any
    mpc: lpvmpc.Mpc
    starts: list[Start]
    show: list[str]
    """The signals of the figure; the first is that of the montage."""
    path: Callable[[Any, lpvmpc.Run], None] | None = None
    """Draws the run as a path, in axes of matplotlib."""
    time_unit: str = "s"


@dataclass(frozen=True)
class Problem:
    """The optimal control problem of a controller, sample by sample the same as its own.

    Cost and bounds as the docstring of `lpvmpc.Mpc` has them; a bound of a state that is exceeded by e costs
    ``price * e`` where the price is finite.
    """

    n: int
    m: int
    horizon: int
    q: Array
    r: Array
    p: Array
    x_lower: Array
    x_upper: Array
    u_lower: Array
    u_upper: Array
    prices: Array
    """Of each state's bounds, (n,): infinite where they are hard, NaN where there are none."""
    step: ca.Function
    """x_{i+1} of x_i and u_i: as many steps of the classical Runge-Kutta method as the controller's."""
    jacobian: ca.Function
    """Its derivatives with respect to x_i, of x_i and u_i."""

    @classmethod
    def of(cls, example: Example) -> Problem:
        mpc, plant = example.mpc, example.mpc.plant
        n, m, settings = len(plant.states), len(plant.inputs), mpc.settings
        q, r = _matrix(settings["q"]), _matrix(settings["r"])
        terminal = settings["terminal"]
        if isinstance(terminal, str):
            p = lpvmpc.lqr(plant, mpc.t_s, q, r).p
        else:
            p = _matrix(terminal)
        bounds = list(mpc.bounds.values())
        lower = np.array([one[0] for one in bounds], dtype=float)
        upper = np.array([one[1] for one in bounds], dtype=float)
        step = runge_kutta(example, mpc.t_s, settings["substeps"])
        x, u = ca.SX.sym("x", n), ca.SX.sym("u", m)
        jacobian = ca.Function("jacobian", [x, u], [ca.jacobian(step(x, u), x)])
        return cls(
            n=n, m=m, horizon=mpc.horizon, q=q, r=r, p=p,
            x_lower=lower[:n], x_upper=upper[:n], u_lower=lower[n:], u_upper=upper[n:],
            prices=_prices(settings["state_bounds"], p, lower[:n], upper[:n]),
            step=step, jacobian=jacobian,
        )  # fmt: skip

    def prices_from(self, x: Array, x_ref: Array, u_ref: Array) -> Array:
        """The prices of a sample at `x` whose references end at `x_ref` and whose input reference begins with `u_ref`: far
        away they are higher. Written down once more from the documentation of `lpvmpc::ControllerSettings::raise_prices`."""
        e = x - x_ref
        slope = 2 * (self.p + self.horizon * self.q) @ e
        diagonal = np.diag(self.p)
        own = np.where(diagonal > 0, diagonal, abs(self.p).max())
        of_way = 4 * np.sqrt(own * (e @ slope) / 2)
        of_excess = abs((self.jacobian(x, u_ref).full() - np.eye(self.n)).T @ slope)
        # NaN, where there is no price, stays.
        return np.maximum(self.prices, np.maximum(of_way, of_excess))

    def excess(self, x: Array, bounds: tuple[Array, Array] | None = None) -> Array:
        """By how much states exceed their bounds, in the states' units."""
        lower, upper = bounds if bounds is not None else (self.x_lower, self.x_upper)
        found: Array = np.maximum(0.0, np.maximum(lower - x, x - upper))
        return found


def runge_kutta(example: Example, t_s: float, substeps: int) -> ca.Function:
    """The plant over one sample with the input held."""
    columns = [ca.vertcat(*one) if isinstance(one, list) else one
               for one in (example.x, example.u, example.xdot)]  # fmt: skip
    f = ca.Function("f", columns[:2], columns[2:])
    x0, u = ca.SX.sym("x", f.numel_in(0)), ca.SX.sym("u", f.numel_in(1))
    x, h = x0, t_s / substeps
    for _ in range(substeps):
        k1 = f(x, u)
        k2 = f(x + h / 2 * k1, u)
        k3 = f(x + h / 2 * k2, u)
        k4 = f(x + h * k3, u)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function("step", [x0, u], [x])


def by_sample(given: Any, first: int, count: int, t_s: float) -> Array:
    """Rows `first` to `first + count - 1` of something constant, by sample, or a function of time."""
    if callable(given):
        return np.array([given(i * t_s) for i in range(first, first + count)], dtype=float)
    rows = np.atleast_2d(np.asarray(given, dtype=float))
    return rows[np.minimum(np.arange(first, first + count), len(rows) - 1)]


def _matrix(given: ArrayLike) -> Array:
    array = np.asarray(given, dtype=float)
    return array if array.ndim == 2 else np.diag(array.ravel())


def _prices(kind: Any, p: Array, lower: Array, upper: Array) -> Array:
    """Written down once more from the documentation of `lpvmpc::exact_prices`: 20 P_jj times the width of the
    bound (its distance from zero, where there is but one; largest entry of P where P_jj is zero)."""
    bounded = np.isfinite(lower) | np.isfinite(upper)
    if kind == "hard":
        return np.where(bounded, np.inf, np.nan)
    if kind != "soft":
        raise ValueError("state_bounds: the comparison knows \"soft\" and \"hard\"")
    both = np.isfinite(lower) & np.isfinite(upper)
    with np.errstate(invalid="ignore"):
        width = np.where(both, upper - lower, np.where(np.isfinite(lower), abs(lower), abs(upper)))
    slope = np.where(np.diag(p) > 0, np.diag(p), abs(p).max())
    return np.where(bounded, 20 * slope * np.where(width > 0, width, 1.0), np.nan)
