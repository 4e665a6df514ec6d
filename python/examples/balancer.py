"""A two-wheeled balancing robot with motors, along a line.

Model and numbers: Y. Yamamoto, NXTway-GS Model-Based Design: Control of self-balancing two-wheeled robot
built with LEGO Mindstorms NXT, 2008; both wheels under the same voltage.
"""

import casadi as ca
import compare
import lpvmpc
import numpy as np
from problem import Example, Start

G, WHEEL, RADIUS = 9.81, 0.03, 0.04  # m/s^2, kg, m
BODY, LENGTH = 0.6, 0.072  # kg, from the wheel axis to the centre of mass m
WHEEL_INERTIA, PITCH_INERTIA = WHEEL * RADIUS**2 / 2, BODY * LENGTH**2 / 3  # kg m^2
ROTOR, RESISTANCE, BACK_EMF, TORQUE, FRICTION = 1e-5, 6.69, 0.468, 0.317, 0.0022


def example() -> Example:
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")  # wheel angle, tilt, their rates; voltage
    sin, cos, rolling, tilting = ca.sin(x[1]), ca.cos(x[1]), x[2], x[3]
    motor = TORQUE / RESISTANCE * u - (TORQUE * BACK_EMF / RESISTANCE + FRICTION) * (rolling - tilting)
    lever = BODY * LENGTH * RADIUS
    a = (2 * WHEEL + BODY) * RADIUS**2 + 2 * WHEEL_INERTIA + 2 * ROTOR
    b = lever * cos - 2 * ROTOR
    c = BODY * LENGTH**2 + PITCH_INERTIA + 2 * ROTOR
    wheels = 2 * motor + lever * tilting**2 * sin
    body = -2 * motor + BODY * G * LENGTH * sin
    det = a * c - b * b
    xdot = ca.vertcat(rolling, tilting, (c * wheels - b * body) / det, (a * body - b * wheels) / det)
    plant = lpvmpc.Plant.from_casadi(
        x, u, xdot, name="balancer",
        states=["wheel", "tilt", "wheel_rate", "tilt_rate"], inputs=["voltage"],
        units={"wheel": "rad", "tilt": "rad", "wheel_rate": "rad/s", "tilt_rate": "rad/s", "voltage": "V"},
        bounds={"tilt": (-0.35, 0.35), "voltage": (-8, 8)},
        equilibrium=([0, 0, 0, 0], [0]),
    )  # fmt: skip
    mpc = lpvmpc.Mpc(plant, t_s=0.02, horizon=50, q=[0.1, 20, 0.01, 1], r=[1], substeps=4)
    # Four Runge-Kutta steps per sample: the motor's fastest motion takes 4 ms.
    metre = 1 / RADIUS  # rad
    starts = [
        Start("1 m", [0, 0, 0, 0], 8, [metre, 0, 0, 0]),
        Start("0.1 m", [0, 0, 0, 0], 4, [0.1 * metre, 0, 0, 0]),
        Start("2 m at 0.4 m/s", [0, 0, 0, 0], 7, lambda t: [min(0.4 * t, 2) * metre, 0, 0, 0]),
        Start("leaning by 0.3 rad", [0, 0.3, 0, 0], 4),
        Start("leaning by 0.6 rad", [0, 0.6, 0, 0], 4),
        Start("pushed", [0, 0, 15, -3], 4),
    ]
    random = np.random.default_rng(2)
    for i in range(6):
        x0 = random.uniform([-10, -0.4, -5, -2], [10, 0.4, 5, 2])
        starts.append(Start(f"random {i}", x0, 5, [random.uniform(-10, 10), 0, 0, 0]))
    return Example(
        "balancer", "Two-wheeled balancer", x, u, xdot, mpc, starts, show=["wheel", "tilt", "voltage"]
    )


if __name__ == "__main__":
    compare.main(example(), __doc__)
