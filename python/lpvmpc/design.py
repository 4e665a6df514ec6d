"""Regulators about a steady state: linear-quadratic, and certified."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lpvmpc
from ._arrays import column, instance, number, weight, whole
from ._progress import reported
from .certificate import Certificate
from .constraints import Limits, limits
from .errors import SettingError
from .plant import Plant, names_of


@dataclass(frozen=True, eq=False)
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
        error = column("x", x, len(self.x)) - self.x
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
        The weights make no sense, the plant does not stand there, or no regulator stabilises it.
    """
    instance("plant", plant, Plant)
    of_x, of_u = names_of(plant.states), names_of(plant.inputs)
    t_s = number("t_s", t_s)
    at = plant.equilibrium or (np.zeros(len(of_x)), np.zeros(len(of_u)))
    # Copies: the law keeps them.
    x_eq = at[0] if x is None else column("x", x, of_x).copy()
    u_eq = at[1] if u is None else column("u", u, of_u).copy()
    for place, given in (("x", x_eq), ("u", u_eq)):
        if not np.isfinite(given).all():
            raise SettingError(f"{place}: it has an entry that is not finite")
    k, p = _lpvmpc.lqr(plant._native, t_s, weight("q", q, of_x), weight("r", r, of_u), x_eq, u_eq)
    return Lqr(k=k, p=p, x=x_eq, u=u_eq)


def certify(
    plant: Plant,
    t_s: float,
    q: ArrayLike,
    r: ArrayLike,
    x: ArrayLike | None = None,
    u: ArrayLike | None = None,
    *,
    x_bounds: Limits | None = None,
    u_bounds: Limits | None = None,
    enlargement: float = 10.0,
    most_boxes: int | None = None,
    trials: int = 4,
    progress: bool = False,
) -> Certificate:
    """A terminal law, cost and set about an equilibrium, proved for the sampled nonlinear plant.

    Sets as large as the bounds allow are tried first, then halves of them, and of the first two that are proved the
    larger one is kept, its level as high as can be shown. Seconds, as a rule, of linear plants and of nonlinear ones
    with up to four states and one input; minutes where more is nonlinear. Up to 16 states and 6 inputs.

    Parameters
    ----------
    plant
        The plant; its formulas may have kinks (abs, min, max), but no jumps.
    t_s
        Sampling time, s; of a plant in discrete time its period.
    q, r
        The weights of the stage cost: diagonals, (n,) and (m,), or whole.
    x, u
        The equilibrium; without, the plant's, or zero. Newton's method makes it more exact.
    x_bounds, u_bounds
        Bounds that hold in the set, as of `Mpc`; those of the plant without.
    enlargement
        How much dearer the terminal cost may be than the linear-quadratic regulator's, at least 1: the more, the larger
        the set, as a rule.
    most_boxes
        Boxes of states that one proof may look at, 1 to 100 000; without, 4000 of up to eight states, and 8 of more, of
        which each takes long.
    trials
        Proofs of higher levels for each set.
    progress
        Whether to show a progress bar (needs tqdm).

    Raises
    ------
    SettingError
        A setting makes no sense, or the equilibrium is at a bound.
    PlantError
        No proof can be had of a formula: it jumps, or no exact form is known of it.
    CertificateError
        There is no equilibrium nearby, no law, or no proof.

    Examples
    --------
    >>> import lpvmpc
    >>> integrator = lpvmpc.Plant.from_matrices([[0, 1], [0, 0]], [[0], [1]], bounds={"u_0": (-1, 1)})
    >>> certificate = lpvmpc.certify(integrator, t_s=0.1, q=[1, 1], r=[1])
    >>> certificate.contains([0.1, 0])
    True
    """
    instance("plant", plant, Plant)
    of_x, of_u = names_of(plant.states), names_of(plant.inputs)
    at = plant.equilibrium or (np.zeros(len(of_x)), np.zeros(len(of_u)))
    x_eq = at[0] if x is None else column("x", x, of_x)
    u_eq = at[1] if u is None else column("u", u, of_u)
    asked = {
        "t_s": number("t_s", t_s),
        "q": weight("q", q, of_x),
        "r": weight("r", r, of_u),
        "equilibrium": (x_eq.tolist(), u_eq.tolist()),
        "x_bounds": limits("x_bounds", x_bounds, plant.states),
        "u_bounds": limits("u_bounds", u_bounds, plant.inputs),
        "enlargement": number("enlargement", enlargement),
        "most_boxes": None if most_boxes is None else whole("most_boxes", most_boxes),
        "trials": whole("trials", trials, least=0),
    }
    with reported(progress) as report:
        return Certificate(_lpvmpc.certify(plant._native, asked, report))


@dataclass(frozen=True, eq=False)
class Verified:
    """What `verify` has proved, beyond that every claim holds."""

    boxes: int
    """Boxes of states on which the decrease was proved."""
    reach: NDArray[np.float64]
    """|x - x_eq| from the set on, at and between the samples, at most, shape (n,)."""


def verify(certificate: Certificate, plant: Plant, *, progress: bool = False) -> Verified:
    """Proves every claim of a certificate again, from its numbers and the plant's formulas alone.

    Parameters
    ----------
    certificate
        What is claimed.
    plant
        The plant that it is claimed of, with its present parameters.
    progress
        Whether to show a progress bar (needs tqdm).

    Raises
    ------
    FalseClaimError
        A claim is false; the message has a state that shows it.
    CertificateError
        A claim could not be shown, and may be true; or the certificate is of another plant.
    SettingError
        What is given is no certificate or no plant.
    """
    instance("certificate", certificate, Certificate)
    instance("plant", plant, Plant)
    with reported(progress) as report:
        boxes, reach = _lpvmpc.verify(certificate.to_json(), plant._native, report)
    return Verified(boxes=boxes, reach=np.array(reach))
