"""The controllers that ours is compared with: IPOPT through CasADi, and do-mpc."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np
from problem import Array, Example, Problem, Start, by_sample

_QUIET = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}


class Converged:
    """Nonlinear MPC by multiple shooting, solved by IPOPT to 1e-8 at every sample.

    Every sample begins with the plan of the last one, shifted; the first with the better of two: standing at
    the start, and the straight line to the reference. A soft bound has a slack per stage.
    """

    def __init__(self, example: Example) -> None:
        self.problem = problem = Problem.of(example)
        n, m, horizon = problem.n, problem.m, problem.horizon
        x, u = ca.SX.sym("x", n, horizon + 1), ca.SX.sym("u", m, horizon)
        self.soft = np.flatnonzero(np.isfinite(problem.prices))
        slack = ca.SX.sym("s", len(self.soft), horizon)
        x_ref, u_ref = ca.SX.sym("x_ref", n, horizon + 1), ca.SX.sym("u_ref", m, horizon)
        prices = ca.SX.sym("prices", len(self.soft))
        cost = ca.sum1(prices.T @ ca.sum2(slack))
        for i in range(horizon):
            e, v = x[:, i] - x_ref[:, i], u[:, i] - u_ref[:, i]
            cost += ca.bilin(problem.q, e, e) + ca.bilin(problem.r, v, v)
        end = x[:, horizon] - x_ref[:, horizon]
        cost += ca.bilin(problem.p, end, end)
        gaps = x[:, 1:] - problem.step.map(horizon)(x[:, :-1], u)
        bounded = x[[int(j) for j in self.soft], 1:]
        constraints = ca.vertcat(ca.vec(gaps), ca.vec(bounded - slack), ca.vec(bounded + slack))
        unknowns = ca.veccat(x, u, slack)
        nlp = {"x": unknowns, "p": ca.veccat(x_ref, u_ref, prices), "f": cost, "g": constraints}
        options = {**_QUIET, "ipopt.tol": 1e-8, "ipopt.max_iter": 1000}
        self.solver = ca.nlpsol("ipopt", "ipopt", nlp, options)
        self.failures, self.times = 0, []
        self.plan: Array | None = None

    def solve(self, x: Array, x_ref: Array, u_ref: Array, bounds: Any = None) -> Array:
        """The plan from `x`, as the vector of unknowns; `x_ref` (N + 1, n), `u_ref` (N, m)."""
        problem = self.problem
        horizon, soft = problem.horizon, self.soft
        if bounds is None:
            bounds = (np.tile(one, (horizon + 1, 1)) for one in (problem.x_lower, problem.x_upper))
        lower, upper = (np.array(one, dtype=float) for one in bounds)
        soft_lower, soft_upper = lower[1:, soft], upper[1:, soft]
        lower[:, soft], upper[:, soft] = -np.inf, np.inf
        lower[0] = upper[0] = x
        slacks = np.zeros(horizon * len(soft))
        prices = problem.prices_from(x, x_ref[-1], u_ref[0])[soft]
        arguments = {
            "p": np.concatenate([x_ref.ravel(), u_ref.ravel(), prices]),
            "lbx": np.concatenate([lower.ravel(), np.tile(problem.u_lower, horizon), slacks]),
            "ubx": np.concatenate([upper.ravel(), np.tile(problem.u_upper, horizon), slacks + np.inf]),
            "lbg": np.concatenate([np.zeros(horizon * problem.n), slacks - np.inf, soft_lower.ravel()]),
            "ubg": np.concatenate([np.zeros(horizon * problem.n), soft_upper.ravel(), slacks + np.inf]),
        }
        best = None
        for guess in self._guesses(x, x_ref, u_ref):
            start = perf_counter()
            answer = self.solver(x0=guess, **arguments)
            self.times.append(perf_counter() - start)
            solved = self.solver.stats()["success"]
            if best is None or (solved, -float(answer["f"])) > best[:2]:
                best = (solved, -float(answer["f"]), answer["x"].full().ravel())
        assert best is not None
        self.failures += not best[0]
        self.plan = best[2]
        # IPOPT relaxes bounds by 1e-8: a slack below zero would pay.
        spared = np.minimum(0, self.plan[len(self.plan) - len(slacks) :]).reshape(horizon, -1).sum(0)
        self.cost = -best[1] - float(spared @ prices)
        return self.plan

    def _guesses(self, x: Array, x_ref: Array, u_ref: Array) -> list[Array]:
        problem = self.problem
        n, m, horizon = problem.n, problem.m, problem.horizon
        slacks = np.zeros(horizon * len(self.soft))
        if self.plan is None:
            part = np.linspace(0, 1, horizon + 1)[:, None]
            lines = [np.tile(x, (horizon + 1, 1)), (1 - part) * x + part * x_ref[-1]]
            return [np.concatenate([line.ravel(), u_ref.ravel(), slacks]) for line in lines]
        states = self.states
        inputs = self.inputs
        states = np.vstack([states[1:], states[-1:]])
        inputs = np.vstack([inputs[1:], inputs[-1:]])
        return [np.concatenate([states.ravel(), inputs.ravel(), slacks])]

    @property
    def states(self) -> Array:
        """The states of the last plan, (N + 1, n)."""
        n, horizon = self.problem.n, self.problem.horizon
        return self.plan[: n * (horizon + 1)].reshape(horizon + 1, n)

    @property
    def inputs(self) -> Array:
        """The inputs of the last plan, (N, m)."""
        n, m, horizon = self.problem.n, self.problem.m, self.problem.horizon
        return self.plan[n * (horizon + 1) :][: m * horizon].reshape(horizon, m)

    def controller(self, example: Example, start: Start) -> Any:
        """The controller as a function of time and state, for `lpvmpc.simulate`."""
        problem, t_s = self.problem, example.mpc.t_s
        x_ref, u_ref = references(example, start)
        self.plan, self.failures, self.times = None, 0, []

        def control(t: float, x: Array) -> Array:
            i = round(t / t_s)
            bounds = None
            if start.x_bounds is not None:
                bounds = [by_sample(one, i, problem.horizon + 1, t_s) for one in start.x_bounds]
            ahead = by_sample(x_ref, i, problem.horizon + 1, t_s)
            self.solve(x, ahead, by_sample(u_ref, i, problem.horizon, t_s), bounds)
            return self.inputs[0]

        return control


def references(example: Example, start: Start) -> tuple[Any, Any]:
    """x_ref and u_ref where a start leaves them to the plant."""
    plant = example.mpc.plant
    rest = plant.equilibrium or (np.zeros(len(plant.states)), np.zeros(len(plant.inputs)))
    x_ref = rest[0] if start.x_ref is None else start.x_ref
    return x_ref, rest[1] if start.u_ref is None else start.u_ref


def do_mpc_controller(example: Example, start: Start) -> Any:
    """The same problem in do-mpc, with its own options: a discrete model of the same Runge-Kutta steps. Its
    soft bounds hold from the present sample on to the last but one."""
    import do_mpc

    problem, t_s = Problem.of(example), example.mpc.t_s
    model = do_mpc.model.Model("discrete", "SX")
    x = model.set_variable("_x", "x", (problem.n, 1))
    u = model.set_variable("_u", "u", (problem.m, 1))
    x_ref = model.set_variable("_tvp", "x_ref", (problem.n, 1))
    u_ref = model.set_variable("_tvp", "u_ref", (problem.m, 1))
    model.set_rhs("x", problem.step(x, u))
    model.setup()
    mpc = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step = problem.horizon, t_s
    mpc.settings.store_full_solution = False
    mpc.settings.supress_ipopt_output()
    e, v = x - x_ref, u - u_ref
    mpc.set_objective(
        mterm=ca.bilin(problem.p, e, e),
        lterm=ca.bilin(problem.q, e, e) + ca.bilin(problem.r, v, v),
    )
    mpc.set_rterm(u=0.0)
    mpc.bounds["lower", "_u", "u"], mpc.bounds["upper", "_u", "u"] = problem.u_lower, problem.u_upper
    hard = np.isinf(problem.prices)
    mpc.bounds["lower", "_x", "x"] = np.where(hard, problem.x_lower, -np.inf)
    mpc.bounds["upper", "_x", "x"] = np.where(hard, problem.x_upper, np.inf)
    for j in np.flatnonzero(np.isfinite(problem.prices)):
        for side, expression, limit in (
            ("lower", -x[int(j)], -problem.x_lower[j]), ("upper", x[int(j)], problem.x_upper[j]),
        ):  # fmt: skip
            if np.isfinite(limit):
                mpc.set_nl_cons(
                    f"{side}_{j}", expression, limit,
                    soft_constraint=True, penalty_term_cons=problem.prices[j],
                )  # fmt: skip
    known = mpc.get_tvp_template()
    ahead_x, ahead_u = references(example, start)

    def at(t: float) -> Any:
        first = round(float(np.ravel(t)[0]) / t_s)
        rows = by_sample(ahead_x, first, problem.horizon + 1, t_s)
        inputs = by_sample(ahead_u, first, problem.horizon + 1, t_s)
        for k in range(problem.horizon + 1):
            known["_tvp", k, "x_ref"], known["_tvp", k, "u_ref"] = rows[k], inputs[k]
        return known

    mpc.set_tvp_fun(at)
    mpc.setup()
    mpc.x0 = np.asarray(start.x0, dtype=float)
    mpc.set_initial_guess()
    return lambda t, x: mpc.make_step(x.reshape(-1, 1)).ravel()
