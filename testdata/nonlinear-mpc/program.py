"""The optimal control problem by multiple shooting, with an exact L1 penalty, solved by IPOPT."""
import casadi as ca
import numpy as np

from model import Q_DIAGONAL, R

OPTIONS = {
    "print_time": 0,
    "error_on_fail": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.max_iter": 300,
}
# A start that is a shifted solution is close to the new one: begin with a small barrier, and keep
# the start and its multipliers where they are.
WARM = {
    "ipopt.mu_init": 1e-3,
    "ipopt.warm_start_init_point": "yes",
    "ipopt.warm_start_bound_push": 1e-6,
    "ipopt.warm_start_bound_frac": 1e-6,
    "ipopt.warm_start_slack_bound_push": 1e-6,
    "ipopt.warm_start_slack_bound_frac": 1e-6,
    "ipopt.warm_start_mult_bound_push": 1e-6,
}
# States beyond this [rad, rad/s] are no start.
RUNAWAY = 100.0
CONVERGED = "Solve_Succeeded"


class Plan:
    """A trajectory (x: 4 by N+1, u: N) that IPOPT ended with, and its objective with the penalty."""

    def __init__(self, x, u, objective, converged, iterations, raw):
        self.x, self.u, self.objective = x, u, objective
        self.converged, self.iterations, self.raw = converged, iterations, raw

    def moved_on(self):
        """The trajectory one sample later, its last state and input kept."""
        return np.hstack([self.x[:, 1:], self.x[:, -1:]]), np.append(self.u[1:], self.u[-1])

    def bound_multipliers(self):
        """Multipliers of the hard state bounds, 3 by N."""
        return self.raw["lam_x"].full().reshape(self.u.size, -1)[:, 2:].T


class Problem:
    """The optimal control problem of one horizon and one sampling time.

    The variables of stage i are u_i, x_{i+1} and, with soft bounds, the excess e+ and e- of theta,
    phi_dot and theta_dot over their upper and lower bounds. Its price is the design's, `raised` with the way.
    """

    def __init__(self, design, predict, horizon, soft=True, raised=False, tolerance=1e-8):
        self.design, self.horizon, self.soft, self.raised = design, horizon, soft, raised
        x0, goal, price = ca.SX.sym("x0", 4), ca.SX.sym("goal", 4), ca.SX.sym("price", 3)
        x, variables, rows, cost = x0, [], [], 0
        for i in range(horizon):
            e = x - goal
            u, after = ca.SX.sym(f"u{i}"), ca.SX.sym(f"x{i + 1}", 4)
            cost += ca.dot(Q_DIAGONAL * e, e) + R * u**2
            rows.append(predict(x, u) - after)
            variables += [u, after]
            x = after
            if soft:
                over, under = ca.SX.sym(f"over{i}", 3), ca.SX.sym(f"under{i}", 3)
                variables += [over, under]
                rows.append(x[1:] - over + under)
                cost += ca.dot(price, over + under)
        e = x - goal
        cost += ca.bilin(design.p, e, e)
        problem = {
            "x": ca.vertcat(*variables),
            "p": ca.vertcat(x0, goal, price),
            "f": cost,
            "g": ca.vertcat(*rows),
        }
        # Of the variables and of the rows of one stage.
        if soft:
            upper = np.concatenate([[design.torque_bound], np.full(10, np.inf)])
            lower = np.concatenate([-upper[:5], np.zeros(6)])
            row = np.concatenate([np.zeros(4), design.state_bound])
        else:
            upper = np.concatenate([[design.torque_bound, np.inf], design.state_bound])
            lower = -upper
            row = np.zeros(4)
        self.limits = {
            "lbx": np.tile(lower, horizon),
            "ubx": np.tile(upper, horizon),
            "lbg": np.tile(-row, horizon),
            "ubg": np.tile(row, horizon),
        }
        options = {**OPTIONS, "ipopt.tol": tolerance}
        self.cold = ca.nlpsol("cold", "ipopt", problem, options)
        derivatives = {
            "grad_f": self.cold.get_function("nlp_grad_f"),
            "jac_g": self.cold.get_function("nlp_jac_g"),
            "hess_lag": self.cold.get_function("nlp_hess_l"),
        }
        self.warm = ca.nlpsol("warm", "ipopt", problem, {**options, **WARM, **derivatives})

    def pack(self, x, u):
        """The variables of a trajectory."""
        stages = [u[None], x[:, 1:]]
        if self.soft:
            bound = self.design.state_bound[:, None]
            stages += [np.maximum(0, x[1:, 1:] - bound), np.maximum(0, -x[1:, 1:] - bound)]
        return np.vstack(stages).T.ravel()

    def solve(self, x0, goal, start, previous=None):
        """The plan from the trajectory `start`; warm where that is the plan `previous` moved on."""
        price = self.design.price
        if self.raised:
            price = self.design.raised_price(x0, goal, self.horizon)
        parameters = np.concatenate([x0, goal, price])
        arguments = {"x0": self.pack(*start), "p": parameters, **self.limits}
        solver = self.cold
        if previous is not None:
            solver = self.warm
            arguments["lam_x0"] = shifted(previous.raw["lam_x"], self.horizon)
            arguments["lam_g0"] = shifted(previous.raw["lam_g"], self.horizon)
        raw = solver(**arguments)
        stats = solver.stats()
        stages = raw["x"].full().reshape(self.horizon, -1).T
        u = np.clip(stages[0], -self.design.torque_bound, self.design.torque_bound)
        x = np.hstack([x0[:, None], stages[1:5]])
        objective = self.design.objective(x, u, goal, price)
        return Plan(x, u, objective, stats["return_status"] == CONVERGED, stats["iter_count"], raw)


def shifted(values, horizon):
    """The values of the stages moved on by one sample, the last ones twice."""
    stages = values.full().reshape(horizon, -1)
    return np.vstack([stages[1:], stages[-1:]]).ravel()


def rollout(predict, design, aim, x0, horizon):
    """The predictor under the regulator towards `aim`, clipped; None where it runs away."""
    x, u = np.empty((4, horizon + 1)), np.empty(horizon)
    x[:, 0] = x0
    for i in range(horizon):
        u[i] = np.clip(-design.k @ (x[:, i] - aim), -design.torque_bound, design.torque_bound)
        x[:, i + 1] = predict(x[:, i], u[i]).full().ravel()
        if not np.abs(x[1:, i + 1]).max() < RUNAWAY:
            return None
    return x, u


def cold_starts(design, predict, x0, goal, horizon, every=True):
    """Starts without a former plan: the regulator's loops and, for `every`, more of their kind."""
    starts = []
    # On the spot, towards points part of the way, and towards the target.
    for share in (0.0, 0.1, 0.3, 1.0) if every else (0.0, 0.3, 1.0):
        aim = np.array([x0[0] + share * (goal[0] - x0[0]), 0.0, 0.0, 0.0])
        starts.append(rollout(predict, design, aim, x0, horizon))
    if every:
        # Straight lines to a stand on the spot and at the target; they are no motions of the robot.
        for end in (np.array([x0[0], 0.0, 0.0, 0.0]), goal):
            starts.append((np.linspace(x0, end, horizon + 1).T, np.zeros(horizon)))
    return [start for start in starts if start is not None]


def best(plans):
    """The cheapest of the plans that converged, else the cheapest of all."""
    return min(plans, key=lambda plan: (not plan.converged, plan.objective))
