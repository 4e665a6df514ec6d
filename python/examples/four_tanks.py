"""Four tanks, two pumps: the levels of the lower two are tracked through their steady states.

Model and numbers: K. H. Johansson, The quadruple-tank process: a multivariable laboratory process with an
adjustable zero, IEEE Transactions on Control Systems Technology 8(3), 2000: its minimum phase setting.
"""

import casadi as ca
import compare
import lpvmpc
import numpy as np
from problem import Example, Start

AREA, OUTLET = np.array([28, 32, 28, 32.0]), np.array([0.071, 0.057, 0.071, 0.057])  # cm^2
G, PUMPS, SPLIT = 981.0, np.array([3.33, 3.35]), np.array([0.70, 0.60])  # cm/s^2, cm^3/(V s)
INFLOW = np.zeros((4, 2))  # of each pump into each tank, cm/(V s)
INFLOW[0, 0], INFLOW[3, 0] = SPLIT[0] * PUMPS[0], (1 - SPLIT[0]) * PUMPS[0]
INFLOW[1, 1], INFLOW[2, 1] = SPLIT[1] * PUMPS[1], (1 - SPLIT[1]) * PUMPS[1]


def steady(lower, disturbance=(0, 0, 0, 0)) -> tuple[np.ndarray, np.ndarray]:
    """Levels and voltages at rest with these levels of the lower tanks, and so much added to f, cm/s."""
    extra = AREA * disturbance
    flow = OUTLET[:2] * np.sqrt(2 * G * np.asarray(lower))
    u = np.linalg.solve(INFLOW[:2] + INFLOW[2:], flow - extra[:2] - extra[2:])
    upper = INFLOW[2:] @ u + extra[2:]
    return np.concatenate([lower, (upper / OUTLET[2:]) ** 2 / (2 * G)]), u


def example() -> Example:
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)  # levels; voltages
    # Nothing flows out of an empty tank; the root has a derivative there, too.
    out = ca.DM(OUTLET) * ca.sqrt(2 * G * ca.fmax(x, 1e-3))
    xdot = (ca.DM(INFLOW) @ u - out + ca.vertcat(out[2:], 0, 0)) / ca.DM(AREA)
    levels, pumps = ["level_1", "level_2", "level_3", "level_4"], ["pump_1", "pump_2"]
    plant = lpvmpc.Plant.from_casadi(
        x, u, xdot, name="four tanks", states=levels, inputs=pumps,
        units={**dict.fromkeys(levels, "cm"), **dict.fromkeys(pumps, "V")},
        bounds={**dict.fromkeys(levels, (0.5, 20)), **dict.fromkeys(pumps, (0, 10))},
        equilibrium=steady([12.4, 12.7]),
    )  # fmt: skip
    mpc = lpvmpc.Mpc(plant, t_s=5, horizon=30, q=[1, 1, 0.01, 0.01], r=[0.1, 0.1])
    x0 = steady([12.4, 12.7])[0]
    starts = [
        Start("up and down", x0, 150, *steady([16, 11])),
        Start("up", x0, 150, *steady([16, 16])),
        Start("nearly empty", [1, 1, 1, 1], 600, *steady([12.4, 12.7])),
        Start("nearly full", [19.5, 19.5, 10, 10], 600, *steady([10, 9])),
        Start("far apart", [19, 1, 1, 15], 600, *steady([10, 13])),
    ]
    return Example(
        "four_tanks", "Four tanks", x, u, xdot, mpc, starts, show=["level_1", "level_2", *pumps]
    )


if __name__ == "__main__":
    compare.main(example(), __doc__)
