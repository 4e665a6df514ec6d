"""An inverted pendulum on a driven arm.

Model, numbers, weights, start: C. Hespe, H. Werner, Convergence properties of fast quasi-LPV model predictive
control, IEEE Conference on Decision and Control 2021. There Euler's method samples it, and the torque has no
bound; here Runge-Kutta steps do, and it has one.
"""

import casadi as ca
import compare
import lpvmpc
import numpy as np
from problem import Example, Start

ARM, ARM_CENTRE, ROD = 0.1395, 0.06975, 0.078  # lengths, m
ARM_MASS, ENCODER, ROD_MASS = 0.115, 0.130, 0.0731  # kg
FRICTION, ROD_FRICTION, G = 1.3e-3, 2.2e-5, 9.81  # N m s, N m s, m/s^2


def example() -> Example:
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")  # angles from upright of arm and rod, their rates; torque
    between, (arm_rate, rod_rate) = x[0] - x[1], (x[2], x[3])
    coupling = ROD_MASS * ARM * ROD
    a, b, c = (ARM_MASS + ROD_MASS) * ARM**2, coupling * ca.cos(between), ROD_MASS * ROD**2
    weight = ARM_MASS * ARM_CENTRE + (ENCODER + ROD_MASS) * ARM
    arm = u + weight * G * ca.sin(x[0]) - coupling * ca.sin(between) * rod_rate**2 - FRICTION * arm_rate
    rod = (
        ROD_MASS * ROD * G * ca.sin(x[1]) + coupling * ca.sin(between) * arm_rate**2
        - ROD_FRICTION * rod_rate
    )  # fmt: skip
    det = a * c - b * b
    xdot = ca.vertcat(arm_rate, rod_rate, (c * arm - b * rod) / det, (a * rod - b * arm) / det)
    plant = lpvmpc.Plant.from_casadi(
        x, u, xdot, name="arm-driven pendulum",
        states=["arm", "rod", "arm_rate", "rod_rate"], inputs=["torque"],
        units={"arm": "rad", "rod": "rad", "arm_rate": "rad/s", "rod_rate": "rad/s", "torque": "N m"},
        bounds={"torque": (-1, 1)},
        equilibrium=([0, 0, 0, 0], [0]),
    )  # fmt: skip
    mpc = lpvmpc.Mpc(plant, t_s=0.01, horizon=40, q=[200, 1000, 0.1, 10], r=[2000])
    starts = [
        Start("of the paper", [np.pi / 3, 0, 0, 0], 2),
        Start("arm at a right angle", [np.pi / 2, 0, 0, 0], 2),
        Start("arm at 2 rad", [2, 0, 0, 0], 2),
        Start("rod leaning by 0.3 rad", [0, 0.3, 0, 0], 2),
        Start("rod leaning by 1 rad", [0, 1.0, 0, 0], 2),
        Start("both at pi/3", [np.pi / 3, np.pi / 3, 0, 0], 2),
        Start("hit", [0, 0, 0, 8], 2),
        Start("arm hanging", [np.pi, 0, 0, 0], 2),
    ]
    random = np.random.default_rng(4)
    for i in range(6):
        x0 = random.uniform([-1.5, -0.5, -4, -4], [1.5, 0.5, 4, 4])
        starts.append(Start(f"random {i}", x0, 2))
    return Example(
        "arm_pendulum", "Arm-driven inverted pendulum", x, u, xdot, mpc, starts,
        show=["arm", "rod", "torque"],
    )  # fmt: skip


if __name__ == "__main__":
    compare.main(example(), __doc__)
