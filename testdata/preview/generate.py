"""Optimal plans of a pendulum whose problem changes along the horizon, by IPOPT. Writes optima.csv."""
import csv

import casadi as ca
import numpy as np

N, T_S, SUBSTEPS = 20, 0.05, 2
P = np.array([[147.0, 40.0], [40.0, 15.0]])
COLUMNS = ["angle", "rate", "phase", "weight", "gust", "gust_stage", "gap", "price", "stiffer", "cross", "slope"]


def derivative(x, u, stiffness, push):
    return ca.vertcat(x[1] + 0.05, stiffness * ca.sin(x[0]) - 0.1 * x[1] + u + push)


def advance(x, u, stiffness, push):
    h = T_S / SUBSTEPS
    for _ in range(SUBSTEPS):
        k1 = derivative(x, u, stiffness, push)
        k2 = derivative(x + h / 2 * k1, u, stiffness, push)
        k3 = derivative(x + h / 2 * k2, u, stiffness, push)
        k4 = derivative(x + h * k3, u, stiffness, push)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def problem(case):
    """Variables, their bounds, rows, their bounds, cost."""
    opti = ca.Opti()
    x, u = opti.variable(2, N + 1), opti.variable(1, N)
    opti.subject_to(x[:, 0] == [case["angle"], case["rate"]])
    cost = 0

    def soft(value, limit, linear, quadratic):
        nonlocal cost
        for side in (value - limit, -value - limit):
            excess = opti.variable()
            opti.subject_to(excess >= 0)
            opti.subject_to(excess >= side)
            cost += linear * excess + quadratic * excess**2 / 2

    for i in range(N + 1):
        error = x[:, i] - np.array([0.1 * np.sin(0.3 * i + case["phase"]), 0.0])
        if i > 0:
            soft(x[1, i], 0.8 + 0.5 * i / N, case["price"], 2.0)
            opti.subject_to(x[0, i] + 0.2 * x[1, i] <= case["gap"] + 0.5 * np.exp(-0.3 * i))
        cost += case["slope"] * (0.1 * x[0, i] - 0.05 * x[1, i])
        if i == N:
            cost += ca.bilin(P, error, error)
            break
        cost += (1 + case["weight"] * i / N) * error[0] ** 2 + 0.1 * error[1] ** 2
        away = u[i] + 0.5 * np.sin(0.2 * i)
        cost += (0.1 + 0.05 * np.cos(i)) * away**2
        cost += 2 * case["cross"] * away * (0.1 * error[0] + 0.03 * error[1])
        cost += case["slope"] * 0.2 * np.sin(0.5 * i) * u[i]
        limit = 4 + 2 * np.sin(i + case["phase"])
        opti.subject_to(opti.bounded(-limit, u[i], limit))
        soft(2 * x[0, i] + 0.3 * x[1, i] + u[i], 3.0, 1.0, 10.0)
        stiffness = 9.81 if i < 8 else 9.81 + case["stiffer"]
        push = case["gust"] if i >= case["gust_stage"] else 0.0
        opti.subject_to(x[:, i + 1] == advance(x[:, i], u[i], stiffness, push))
    opti.minimize(cost)
    options = {"print_time": 0, "error_on_fail": False}
    quiet = {"print_level": 0, "sb": "yes", "max_iter": 1000, "tol": 1e-11}
    # A price times what a bound is relaxed by would be missing from the cost.
    quiet["bound_relax_factor"] = 0.0
    opti.solver("ipopt", options, quiet)
    return opti, x, u, cost


def optimum(case):
    """Cost and first input of the best plan from three starts; None if none converges."""
    best = None
    for start in (0.0, case["angle"], -0.3):
        opti, x, u, cost = problem(case)
        opti.set_initial(x[0, :], start)
        try:
            solution = opti.solve()
        except RuntimeError:
            continue
        found = float(solution.value(cost)), float(solution.value(u)[0])
        if opti.stats()["success"] and (best is None or found < best):
            best = found
    return best


def main():
    rng = np.random.default_rng(4)
    with open("optima.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*COLUMNS, "cost", "u0"])
        rows = 0
        while rows < 40:
            case = {
                "angle": round(rng.uniform(-0.4, 0.4), 3),
                "rate": round(rng.uniform(-1.0, 1.0), 3),
                "phase": round(rng.uniform(0, 6), 3),
                "weight": round(rng.uniform(0, 5), 3),
                "gust": round(rng.uniform(-2, 2), 3),
                "gust_stage": int(rng.integers(0, N)),
                "gap": round(rng.uniform(-0.1, 0.1), 3),
                "price": round(10 ** rng.uniform(0, 2), 3),
                "stiffer": round(rng.uniform(-4, 4), 3),
                "cross": round(rng.uniform(-1, 1), 3),
                "slope": round(rng.uniform(-5, 5), 3),
            }
            best = optimum(case)
            if best is None:
                continue
            writer.writerow([*case.values(), f"{best[0]:.12g}", f"{best[1]:.9g}"])
            rows += 1


if __name__ == "__main__":
    main()
