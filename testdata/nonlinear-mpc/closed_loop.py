"""The closed loop of the ballbot with nonlinear or with linear MPC, and what is measured in it."""
import math

import casadi as ca
import numpy as np

from model import plant, stage_cost
from program import Problem, best, cold_starts

# All cold starts come with the first sample and with every one that did not converge; some of them
# every so often, while the regulator's cost to go is above a share of the cost so far.
COLD_EVERY = 10
COLD_ABOVE = 1e-6
# A cold start found another, better minimum when it is cheaper by more than this share.
BETTER = 1e-6
# The loop ends when the regulator's cost to go is below this share of the cost so far.
NEGLIGIBLE = 1e-10
# A state is outside when it exceeds its bound by more than this share of it.
OUTSIDE = 1e-4
PLANT = plant()


class Controller:
    """MPC by IPOPT with the predictor that it is given, from the former plan and from cold starts."""

    def __init__(self, design, predict, horizon, **options):
        self.design, self.predict, self.horizon = design, predict, horizon
        self.problem = Problem(design, predict, horizon, **options)
        self.plan, self.not_converged, self.better_cold = None, 0, 0

    def converge(self, x, goal, cold, all_starts=False):
        """The torque at state x, from the former plan and, if asked for, from cold starts."""
        plans = []
        if self.plan is not None:
            plans.append(self.problem.solve(x, goal, self.plan.moved_on(), self.plan))
        missed = not plans or not plans[0].converged
        if cold or missed:
            every = missed or all_starts
            starts = cold_starts(self.design, self.predict, x, goal, self.horizon, every)
            plans += [self.problem.solve(x, goal, start) for start in starts]
        self.plan = best(plans)
        self.not_converged += not self.plan.converged
        if not missed:
            self.better_cold += self.plan.objective < (1 - BETTER) * plans[0].objective
        return self.plan.u[0]


class Nonlinear(Controller):
    """Nonlinear MPC, converged at every sample."""

    def __init__(self, design, horizon, **options):
        super().__init__(design, design.predict, horizon, **options)

    def torque(self, x, goal, sample, remaining):
        return self.converge(x, goal, sample % COLD_EVERY == 0 and remaining > COLD_ABOVE)


class Linear(Controller):
    """Linear MPC: the same program with the sampled pair of the upright equilibrium throughout."""

    def __init__(self, design, horizon, **options):
        x, u = ca.SX.sym("x", 4), ca.SX.sym("u")
        predict = ca.Function("linear", [x, u], [ca.mtimes(design.a, x) + design.b * u])
        super().__init__(design, predict, horizon, **options)

    def regulated(self, e):
        """Whether the regulator keeps all bounds over the horizon; then it is the optimum."""
        for _ in range(self.horizon):
            u = -self.design.k @ e
            e = self.design.a @ e + self.design.b[:, 0] * u
            bounds = self.design
            if abs(u) > bounds.torque_bound or (np.abs(e[1:]) > bounds.state_bound).any():
                return False
        return True

    def torque(self, x, goal, sample, remaining):
        if self.regulated(x - goal):
            self.plan = None
            return -self.design.k @ (x - goal)
        return self.converge(x, goal, False)


class Loop:
    """One closed loop: its cost, the samples outside the state bounds, and how it went."""

    def __init__(self, controller, start, goal, duration):
        t_s, p = controller.design.t_s, controller.design.p
        state_bound = controller.design.state_bound
        x = np.array(start, dtype=float)
        self.cost, self.outside, self.largest_excess, self.fell = 0.0, 0, 0.0, False
        # The regulator's cost to go over the cost so far.
        remaining = math.inf
        for sample in range(round(duration / t_s)):
            u = controller.torque(x, goal, sample, remaining)
            self.cost += float(stage_cost(x, u, goal))
            for _ in range(round(t_s * 1000)):
                x = PLANT(x, u).full().ravel()
                self.fell = self.fell or not abs(x[1]) <= math.pi / 2
            if self.fell:
                self.cost = math.inf
                break
            excess = float(np.max(np.abs(x[1:]) / state_bound)) - 1
            self.outside += int(excess > OUTSIDE)
            self.largest_excess = max(self.largest_excess, excess)
            remaining = (x - goal) @ p @ (x - goal) / self.cost
            if remaining < NEGLIGIBLE:
                break
        self.not_converged = controller.not_converged
        self.better_cold = int(controller.better_cold)


def both(design, horizon, start, goal, duration, **options):
    """The loops of nonlinear and of linear MPC."""
    return tuple(
        Loop(make(design, horizon, **options), start, goal, duration) for make in (Nonlinear, Linear)
    )


COLUMNS = (
    "cost_nonlinear,cost_linear,outside_nonlinear,largest_excess_nonlinear,outside_linear,"
    "largest_excess_linear,not_converged,not_converged_linear,better_cold,fell_nonlinear,fell_linear"
)


def values(nonlinear, linear):
    """What follows a case in the tables, in the order of COLUMNS."""
    return (
        nonlinear.cost, linear.cost, nonlinear.outside, nonlinear.largest_excess,
        linear.outside, linear.largest_excess, nonlinear.not_converged, linear.not_converged,
        nonlinear.better_cold, int(nonlinear.fell), int(linear.fell),
    )
