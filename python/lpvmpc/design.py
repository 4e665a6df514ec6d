"""The linear-quadratic regulator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lpvmpc
from ._arrays import column, weight
from .plant import Plant


@dataclass(frozen=True)
class Lqr:
    """A sampled linear-quadratic regulator, u = u_eq - K (x - x_eq)."""

    k: NDArray[np.float64]
    """K, shape (m, n)."""
    p: NDArray[np.float64]
    """P, shape (n, n): (x - x_eq)'P (x - x_eq) is the cost of all samples to come."""
    x: NDArray[np.float64]
    """x_eq, shape (n,)."""
    u: NDArray[np.float64]
    """u_eq, shape (m,)."""

    def __call__(self, t: float, x: ArrayLike) -> NDArray[np.float64]:
        """The input at the state `x`: as a controller of `simulate`, which tells the time `t`, too."""
        error = np.asarray(x, dtype=np.float64) - self.x
        found: NDArray[np.float64] = self.u - self.k @ error
        return found


def lqr(
    plant: Plant,
    t_s: float,
    q: ArrayLike,
    r: ArrayLike,
    x: ArrayLike | None = None,
    u: ArrayLike | None = None,
) -> Lqr:
    """The linear-quadratic regulator of a plant about a steady state, sampled with the input held.

    Parameters
    ----------
    plant
        The plant.
    t_s
        Sampling time, s; of a plant in discrete time its period.
    q, r
        The weights: diagonals, (n,) and (m,), or whole.
    x, u
        The steady state; without, the plant's equilibrium, or zero.

    Raises
    ------
    SettingError
        The weights make no sense, or no regulator stabilises the plant there.
    """
    n, m = len(plant.states), len(plant.inputs)
    at = plant.equilibrium or (np.zeros(n), np.zeros(m))
    x_eq = at[0] if x is None else column("x", x, n)
    u_eq = at[1] if u is None else column("u", u, m)
    k, p = _lpvmpc.lqr(plant._native, t_s, weight("q", q, n), weight("r", r, m), x_eq, u_eq)
    return Lqr(k=k, p=p, x=x_eq, u=u_eq)
