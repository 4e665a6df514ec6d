"""The plan of a sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ActiveBound:
    """A bound that a plan runs into."""

    stage: int
    """The stage, from 0 to N."""
    bound: str
    """The bound in words: ``"force >= -10 N"``."""
    multiplier: float
    """Its Lagrange multiplier, in cost per unit of the quantity."""
    exceeded: bool
    """Whether it is a soft bound that is exceeded."""


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Plan:
    """The plan of a sample: what `Mpc.step` answers.

    Whatever the status, the inputs are finite and within their bounds; unless `is_solved` they
    are a fallback, not an optimum.
    """

    u: Array
    """The inputs u_0 to u_{N-1}, shape (N, m), in input units."""
    x: Array
    """The states x_0 to x_N, shape (N + 1, n), in state units: the measured one, and what the model makes
    of the inputs."""
    status: str
    """``"converged"``, ``"improved"``, ``"no improvement"`` (a descent), ``"solved"`` (a fixed number of
    programs), and of those that are no plan ``"infeasible"``, ``"exceeded"`` (a hard bound, in a descent, and nothing
    proves that it has to be), ``"inaccurate"``, ``"max changes"``, ``"no memory"``, ``"numerical failure"``, ``"not finite"``, ``"refused"``."""
    message: str
    """The status in words, with the plant's names: ``"infeasible: position <= 0.5 m at stage 7 against
    force >= -10 N at stages 0 to 6"``."""
    is_solved: bool
    """Whether the inputs are a plan: an optimum, or a motion of the nonlinear model that the
    programs confirm or improve."""
    cost: float
    """The cost along `x` and `u`, without the prices of bounds."""
    programs: int
    """How many quadratic programs were solved."""
    _active: list[tuple[int, str, float, bool]]
    active_bounds: str
    """The bounds that hold with equality or are exceeded, in words: ``"force >= -10 N at stages 0
    to 6"``, or ``"no active bound"``."""
    decision: str | None = None
    """With a certificate, what the first input is backed by: ``"new plan"``, ``"candidate"`` (the rest of the last
    plan), ``"terminal law"``; and where no plan is known that keeps the bounds and ends in the certified set,
    ``"soft bounds"`` or ``"saturated LQR"``."""
    x_target: Array | None = None
    """The steady state nearest to the end of the reference, shape (n,), which is tracked in place of a constant reference.
    None where there is a `u_ref`, and where none was found: the reference is then tracked as it is. With a certificate it is
    the one about which the plan ends in the set; None where nothing is guaranteed."""
    u_target: Array | None = None
    """The input that holds it, shape (m,), which costs nothing."""

    @property
    def is_guaranteed(self) -> bool:
        """Whether, with a certificate, there will be a plan at every later sample: states at the samples and inputs
        keep their bounds, and the plan's cost falls by the stage cost while references beyond the horizon stay; while
        the plant is the model, up to the error of its Runge-Kutta steps, for which a thousandth of the bounds is kept,
        its state is known exactly and its input acts at once. Of a plan by `Mpc.decide` it is said of the model alone,
        from the estimated state, under the disturbances beside the inputs as they are estimated then: the plant keeps
        to it as far as the estimate is right and stays."""
        return self.decision in ("new plan", "candidate", "terminal law")

    @property
    def u0(self) -> Array:
        """The input to apply until the next sample, shape (m,)."""
        first: Array = self.u[0]
        return first

    @property
    def active(self) -> list[ActiveBound]:
        """The bounds that hold with equality, or are exceeded at a price, by stage."""
        return [ActiveBound(*one) for one in self._active]

    def __repr__(self) -> str:
        inputs = ", ".join(f"{one:.6g}" for one in self.u0)
        return f"<Plan: {self.message}; u0 = [{inputs}], cost {self.cost:.6g}, {self.active_bounds}>"
