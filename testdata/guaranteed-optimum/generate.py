"""Optima of the guaranteed problem by IPOPT, as a reference for the guaranteed loop.

The problem of one sample, transcribed by direct multiple shooting with the plant's own equations of
motion; it shares no code with the crates:

    minimise  sum ||x_i - z d||_Q^2 + R u_i^2 (i = 0 to N-1) + V(x_N - z d) + weight (z - wanted)^2
    subject to x_{i+1} = x_i after a sample under u_i, x_0 given, bounds on x_1 to x_N and on u,
               V(x_N - z d) <= level

    python generate.py            # writes optima.csv and loops.csv; needs numpy and casadi (IPOPT)
"""
import csv
import json
import pathlib
import sys

import casadi as ca
import numpy as np

HERE = pathlib.Path(__file__).parent
CERTIFICATE = HERE / "../../crates/ballbot-scenario/src/builtin/terminal-certificate.json"
SUBSTEPS = 6
TS = 0.05
Q = np.diag([200.0, 1.0, 0.1, 0.1])
R = 1000.0
X_MAX = np.array([np.pi / 3, 10 * np.pi, 2 * np.pi])
U_MAX = 1.5
HORIZONS = [5, 8, 12, 20, 20, 20, 30, 40, 60]
WANTED = 1e2

document = json.loads(CERTIFICATE.read_text())["certificate"]["terminal"]
K, P, LEVEL = np.array(document["k"]), np.array(document["p"]), document["level"]
WEIGHT = P[0, 0]


def motion(x, u):
    """x_dot, from the mass matrix (eq. (1) and (2) of the paper)."""
    b1, b2, b3, b4 = 0.002483, 0.059325, 0.143093, -0.07436
    length, ball, wheel, gravity = 0.2978, 0.12, 0.05, 9.81
    s, c = ca.sin(x[1]), ca.cos(x[1])
    coupling = b2 - length * ball * c
    determinant = b1 * b3 - coupling**2
    push = ball / wheel * u
    first = push + length * ball * s * x[3] ** 2 - b4 * x[2]
    second = length * gravity * s - push
    return ca.vertcat(x[2], x[3],
                      (b3 * first + coupling * second) / determinant,
                      (coupling * first + b1 * second) / determinant)


def sample_map():
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")
    h, state = TS / SUBSTEPS, x
    for _ in range(SUBSTEPS):
        k1 = motion(state, u)
        k2 = motion(state + h / 2 * k1, u)
        k3 = motion(state + h / 2 * k2, u)
        k4 = motion(state + h * k3, u)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function("sample", [x, u], [state])


SAMPLE = sample_map()


class Problem:
    def __init__(self, horizon):
        self.horizon = horizon
        x = ca.SX.sym("x", 4, horizon + 1)
        u = ca.SX.sym("u", horizon)
        z = ca.SX.sym("z")
        parameter = ca.SX.sym("p", 5)
        d = np.array([1.0, 0, 0, 0])
        cost, rows = WEIGHT * (z - parameter[4]) ** 2, [x[:, 0] - parameter[:4]]
        for i in range(horizon):
            error = x[:, i] - z * d
            cost += ca.bilin(Q, error, error) + R * u[i] ** 2
            rows.append(x[:, i + 1] - SAMPLE(x[:, i], u[i]))
        error = x[:, horizon] - z * d
        value = ca.bilin(P, error, error)
        rows.append(value)
        unknowns = ca.vertcat(ca.vec(x), u, z)
        options = {"ipopt.print_level": 0, "print_time": 0, "ipopt.tol": 1e-8, "ipopt.max_iter": 600,
                   "ipopt.sb": "yes"}
        self.solver = ca.nlpsol("s", "ipopt",
                                {"x": unknowns, "p": parameter, "f": cost + value, "g": ca.vertcat(*rows)},
                                options)
        free = np.array([np.inf])
        state = np.concatenate([free, X_MAX])
        upper = np.concatenate([np.full(4, np.inf), np.tile(state, horizon), np.full(horizon, U_MAX), free])
        self.box = {"lbx": -upper, "ubx": upper}
        equal = np.zeros(4 * (horizon + 1))
        self.box["lbg"] = np.append(equal, -np.inf)
        self.box["ubg"] = np.append(equal, LEVEL)

    def solve(self, x0, wanted, guess):
        answer = self.solver(x0=guess, p=np.append(x0, wanted), **self.box)
        ok = self.solver.stats()["return_status"] in ("Solve_Succeeded", "Solved_To_Acceptable_Level")
        return np.array(answer["x"]).ravel(), float(answer["f"]), ok

    def guess(self, x0, wanted):
        """The terminal law's saturated closed loop around where the robot is."""
        xs, us, x = [x0], [], x0
        for _ in range(self.horizon):
            u = float(np.clip(-(K @ (x - [x0[0], 0, 0, 0]))[0], -U_MAX, U_MAX))
            x = np.array(SAMPLE(x, u)).ravel()
            x = np.clip(x, [x0[0] - 50, -1.2, -32, -6.5], [x0[0] + 50, 1.2, 32, 6.5])
            us.append(u)
            xs.append(x)
        return np.concatenate([np.concatenate(xs), us, [x[0]]])

    def still(self, x0, wanted):
        return np.concatenate([np.tile([x0[0], 0, 0, 0], self.horizon + 1), np.zeros(self.horizon), [x0[0]]])

    def best(self, x0, wanted):
        answers = [self.solve(x0, wanted, g(x0, wanted)) for g in (self.guess, self.still)]
        answers = [answer for answer in answers if answer[2]]
        return min(answers, key=lambda answer: answer[1]) if answers else None

    def shifted(self, y):
        n = self.horizon
        x, u, z = y[:4 * (n + 1)].reshape(n + 1, 4), y[4 * (n + 1):-1], y[-1]
        last = float(np.clip(-(K @ (x[-1] - [z, 0, 0, 0]))[0], -U_MAX, U_MAX))
        end = np.array(SAMPLE(x[-1], last)).ravel()
        return np.concatenate([x[1:].ravel(), end, u[1:], [last, z]])


def closed_loop(problem, x0, wanted, samples):
    """Cost of nonlinear MPC to convergence: stage costs about the wanted set point."""
    x, y, cost = np.array(x0), None, 0.0
    for _ in range(samples):
        warm = problem.solve(x, wanted, problem.shifted(y)) if y is not None else None
        answer = warm if warm is not None and warm[2] else problem.best(x, wanted)
        if answer is None:
            return np.nan
        y = answer[0]
        u = y[4 * (problem.horizon + 1)]
        error = x - [wanted, 0, 0, 0]
        cost += error @ Q @ error + R * u * u
        x = np.array(SAMPLE(x, u)).ravel()
    return cost


def draw(random):
    """From rest and in motion, tilts to 59 degrees, set points to 100 rad, near ones as often."""
    kind = random.integers(3)
    tilt = np.deg2rad(59.0) * random.uniform(-1, 1)
    rates = [0.0, 0.0] if kind == 0 else [random.uniform(-8, 8), random.uniform(-2, 2)]
    wanted = random.uniform(-WANTED, WANTED) if random.random() < 0.5 else random.uniform(-5, 5)
    return np.array([0.0, tilt, *rates]), wanted


def main(count, loops, samples=100, seed=1):
    random = np.random.default_rng(seed)
    problems, rows, chosen, drawn = {}, [], [], 0
    while len(rows) < count:
        horizon = HORIZONS[drawn % len(HORIZONS)]
        drawn += 1
        x0, wanted = draw(random)
        if horizon not in problems:
            problems[horizon] = Problem(horizon)
        answer = problems[horizon].best(x0, wanted)
        if answer is None:
            continue
        rows.append([horizon, *x0, wanted, answer[0][-1], answer[1]])
    write("optima.csv", ["horizon", "phi_rad", "theta_rad", "phi_dot_rad_s", "theta_dot_rad_s",
                         "wanted_rad", "set_point_rad", "cost"], rows)
    print(f"{len(rows)} optima of {drawn} drawn starts", flush=True)
    runs = []
    for row in rows:
        if len(runs) == loops:
            break
        cost = closed_loop(problems[row[0]], np.array(row[1:5]), row[5], samples)
        if np.isfinite(cost):
            runs.append([*row[:6], samples, cost])
            write("loops.csv", ["horizon", "phi_rad", "theta_rad", "phi_dot_rad_s", "theta_dot_rad_s",
                                "wanted_rad", "samples", "cost"], runs)


def write(name, head, rows):
    with open(HERE / name, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        writer.writerows([repr(float(v)) if isinstance(v, float) else v for v in row] for row in rows)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 240, int(sys.argv[2]) if len(sys.argv) > 2 else 60)
