"""Optimal plans of a car with nonlinear outputs and costs on the change of its inputs, by IPOPT. Writes optima.csv."""
import csv

import casadi as ca
import numpy as np

N, T_S = 20, 0.1
Q, R, R_DU, P = np.diag([1.0, 1.0, 0.1, 0.2]), np.diag([0.1, 0.2]), np.diag([0.5, 0.3]), np.diag([5.0, 5.0, 1.0, 1.0])
COLUMNS = ["x", "y", "heading", "speed", "acceleration", "turning", "obstacle_x", "obstacle_y", "radius", "range", "weight", "grip"]


def derivative(x, u):
    """Position [m], heading [rad], speed [m/s] of a car with acceleration [m/s^2] and turning rate [rad/s]."""
    return ca.vertcat(x[3] * ca.cos(x[2]), x[3] * ca.sin(x[2]), u[1], u[0])


def advance(x, u):
    k1 = derivative(x, u)
    k2 = derivative(x + T_S / 2 * k1, u)
    k3 = derivative(x + T_S / 2 * k2, u)
    k4 = derivative(x + T_S * k3, u)
    return x + T_S / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def problem(case):
    opti = ca.Opti()
    x, u = opti.variable(4, N + 1), opti.variable(2, N)
    opti.subject_to(x[:, 0] == [case["x"], case["y"], case["heading"], case["speed"]])
    before = ca.vertcat(case["acceleration"], case["turning"])
    cost = 0
    for i in range(N + 1):
        if i > 0:
            # Outside of a round obstacle, hard.
            away = (x[0, i] - case["obstacle_x"]) ** 2 + (x[1, i] - case["obstacle_y"]) ** 2
            opti.subject_to(case["radius"] ** 2 - away <= 0)
        if i == N:
            cost += ca.bilin(P, x[:, i], x[:, i])
            break
        cost += ca.bilin(Q, x[:, i], x[:, i]) + ca.bilin(R, u[:, i], u[:, i])
        cost += ca.bilin(R_DU, u[:, i] - before, u[:, i] - before)
        # The distance from a mast at (0, -1), towards a range.
        mast = ca.sqrt(x[0, i] ** 2 + (x[1, i] + 1) ** 2 + 0.01)
        cost += case["weight"] * (mast - case["range"]) ** 2
        # The lateral acceleration within the grip, at a price.
        for side in (1, -1):
            excess = opti.variable()
            opti.subject_to(excess >= 0)
            opti.subject_to(excess >= side * x[3, i] * u[1, i] - case["grip"])
            cost += 8 * excess + excess**2 / 2
        opti.subject_to(opti.bounded(-2, u[0, i], 2))
        opti.subject_to(opti.bounded(-1.5, u[1, i], 1.5))
        opti.subject_to(opti.bounded(-0.6, u[0, i] - before[0], 0.6))
        opti.subject_to(opti.bounded(-0.5, u[1, i] - before[1], 0.5))
        opti.subject_to(x[:, i + 1] == advance(x[:, i], u[:, i]))
        before = u[:, i]
    opti.minimize(cost)
    options = {"print_time": 0, "error_on_fail": False}
    quiet = {"print_level": 0, "sb": "yes", "max_iter": 1000, "tol": 1e-10}
    # A price times what a bound is relaxed by would be missing from the cost.
    quiet["bound_relax_factor"] = 0.0
    opti.solver("ipopt", options, quiet)
    return opti, x, u, cost


def optima(case, rng):
    """Costs and first inputs of the local optima from several starts, best first."""
    found = []
    for start in range(8):
        opti, x, u, cost = problem(case)
        opti.set_initial(u, 0 if start == 0 else rng.uniform(-1, 1, (2, N)))
        line = np.linspace([case["x"], case["y"], case["heading"], case["speed"]], np.zeros(4), N + 1).T
        line[:2] += 0 if start == 0 else rng.uniform(-1, 1, (2, 1)) * np.sin(np.linspace(0, np.pi, N + 1))
        opti.set_initial(x, line)
        try:
            solution = opti.solve()
        except RuntimeError:
            continue
        if opti.stats()["success"]:
            found.append((float(solution.value(cost)), *map(float, solution.value(u)[:, 0])))
    return sorted(found)


def main():
    rng = np.random.default_rng(7)
    with open("optima.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*COLUMNS, "cost", "u0", "u1"])
        rows = 0
        while rows < 30:
            number = lambda low, high: round(rng.uniform(low, high), 3)
            angle = rng.uniform(-np.pi, np.pi)
            far = rng.uniform(1.5, 3)
            case = {
                "x": round(far * np.cos(angle), 3),
                "y": round(far * np.sin(angle), 3),
                "heading": number(-2, 2),
                "speed": number(-0.5, 1.5),
                "acceleration": number(-1, 1),
                "turning": number(-1, 1),
                "obstacle_x": round(0.5 * far * np.cos(angle) + rng.uniform(-0.3, 0.3), 3),
                "obstacle_y": round(0.5 * far * np.sin(angle) + rng.uniform(-0.3, 0.3), 3),
                "radius": number(0.3, 0.5),
                "range": number(0.5, 2),
                "weight": number(0, 4),
                "grip": number(0.2, 1),
            }
            found = optima(case, rng)
            if not found:
                continue
            best = found[0]
            writer.writerow([*case.values(), f"{best[0]:.12g}", f"{best[1]:.9g}", f"{best[2]:.9g}"])
            rows += 1


if __name__ == "__main__":
    main()
