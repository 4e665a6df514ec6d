"""A rotary (Furuta) pendulum held upright by its motor's voltage.

Model: Lagrange's equations of B. S. Cazzolato, Z. Prime, On the dynamics of the Furuta pendulum, Journal of
Control Science and Engineering 2011, for a slender rod. Numbers: Quanser QUBE-Servo 2, user manual.
"""

import casadi as ca
import compare
import lpvmpc
import numpy as np
from problem import Example, Start

G, ARM, ARM_LENGTH, ROD, ROD_LENGTH = 9.81, 0.095, 0.085, 0.024, 0.129  # m/s^2, kg, m, kg, m
RESISTANCE, MOTOR, ARM_DAMPING, ROD_DAMPING = 8.4, 0.042, 0.0015, 0.0005  # ohm, V s, N m s, N m s


def example() -> Example:
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")  # arm, pendulum from upright, their rates; voltage
    sin, cos, arm_rate, rate = ca.sin(x[1]), ca.cos(x[1]), x[2], x[3]
    half, arm_inertia = ROD_LENGTH / 2, ARM * ARM_LENGTH**2 / 3
    rod = ROD * ROD_LENGTH**2 / 3  # about its joint, kg m^2
    lever = ROD * ARM_LENGTH * half
    torque = MOTOR * (u - MOTOR * arm_rate) / RESISTANCE
    a, b = arm_inertia + ROD * ARM_LENGTH**2 + rod * sin**2, lever * cos
    arm = torque - ARM_DAMPING * arm_rate - 2 * rod * sin * cos * arm_rate * rate + lever * sin * rate**2
    pendulum = rod * sin * cos * arm_rate**2 + ROD * G * half * sin - ROD_DAMPING * rate
    det = a * rod - b * b
    xdot = ca.vertcat(arm_rate, rate, (rod * arm - b * pendulum) / det, (a * pendulum - b * arm) / det)
    plant = lpvmpc.Plant.from_casadi(
        x, u, xdot, name="Furuta pendulum",
        states=["arm", "pendulum", "arm_rate", "rate"], inputs=["voltage"],
        units={"arm": "rad", "pendulum": "rad", "arm_rate": "rad/s", "rate": "rad/s", "voltage": "V"},
        bounds={"arm": (-2, 2), "voltage": (-10, 10)},
        equilibrium=([0, 0, 0, 0], [0]),
    )  # fmt: skip
    mpc = lpvmpc.Mpc(plant, t_s=0.02, horizon=40, q=[5, 10, 0.1, 0.1], r=[0.01])
    starts = [
        Start("half a turn of the arm", [-1.6, 0, 0, 0], 3, [1.6, 0, 0, 0]),
        Start("leaning by 0.4 rad", [0, 0.4, 0, 0], 3),
        Start("leaning by 1 rad", [0, 1.0, 0, 0], 3),
        Start("hit", [0, 0, 0, 6], 3),
        Start("leaning at the stop", [1.9, -0.2, 0, 0], 3),
        Start("0.2 rad of the arm", [0, 0, 0, 0], 3, [0.2, 0, 0, 0]),
    ]
    random = np.random.default_rng(3)
    for i in range(6):
        x0 = random.uniform([-1.8, -0.5, -3, -3], [1.8, 0.5, 3, 3])
        starts.append(Start(f"random {i}", x0, 3, [random.uniform(-1.8, 1.8), 0, 0, 0]))
    starts.append(Start("hanging", [0, np.pi, 0, 0], 4))
    return Example(
        "furuta", "Furuta pendulum", x, u, xdot, mpc, starts, show=["arm", "pendulum", "voltage"]
    )


if __name__ == "__main__":
    compare.main(example(), __doc__)
