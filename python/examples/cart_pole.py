"""A cart with a pole, on a track with ends.

Model: R. V. Florian, Correct equations for the dynamics of the cart-pole system, Center for Cognitive and
Neural Studies, Cluj-Napoca 2007, without friction. Masses, lengths, force and track: A. G. Barto,
R. S. Sutton, C. W. Anderson, Neuronlike adaptive elements that can solve difficult learning control
problems, IEEE Transactions on Systems, Man, and Cybernetics 13(5), 1983.
"""

import casadi as ca
import compare
import lpvmpc
import numpy as np
from problem import Example, Start

CART, POLE, HALF_LENGTH, G = 1.0, 0.1, 0.5, 9.81  # kg, kg, m, m/s^2


def example() -> Example:
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")  # position, angle from upright, their rates; force
    sin, cos, rate, mass = ca.sin(x[1]), ca.cos(x[1]), x[3], CART + POLE
    push = (u + POLE * HALF_LENGTH * rate**2 * sin) / mass
    turn = (G * sin - cos * push) / (HALF_LENGTH * (4 / 3 - POLE * cos**2 / mass))
    xdot = ca.vertcat(x[2], x[3], push - POLE * HALF_LENGTH * turn * cos / mass, turn)
    plant = lpvmpc.Plant.from_casadi(
        x, u, xdot, name="cart-pole",
        states=["position", "angle", "speed", "rate"], inputs=["force"],
        units={"position": "m", "angle": "rad", "speed": "m/s", "rate": "rad/s", "force": "N"},
        bounds={"position": (-2.4, 2.4), "force": (-10, 10)},
        equilibrium=([0, 0, 0, 0], [0]),
    )  # fmt: skip
    mpc = lpvmpc.Mpc(plant, t_s=0.04, horizon=40, q=[10, 10, 0.1, 0.1], r=[0.01])
    starts = [
        Start("end to end", [-2.2, 0, 0, 0], 5, [2.3, 0, 0, 0]),
        Start("leaning at the end", [2.2, 0.25, 0, 0], 5),
        Start("leaning by 0.6 rad", [0, 0.6, 0, 0], 5),
        Start("falling", [0, 0.3, 0, 1.5], 5),
        Start("rolling to the end", [1.2, 0, 1.5, 0], 5),
        Start("1 m aside", [0, 0, 0, 0], 5, [1, 0, 0, 0]),
    ]
    random = np.random.default_rng(1)
    for i in range(6):
        x0 = random.uniform([-2, -0.5, -1, -1], [2, 0.5, 1, 1])
        starts.append(Start(f"random {i}", x0, 5, [random.uniform(-2.2, 2.2), 0, 0, 0]))
    starts.append(Start("hanging", [0, np.pi, 0, 0], 6))
    return Example(
        "cart_pole", "Cart-pole on a track with ends", x, u, xdot, mpc, starts,
        show=["position", "angle", "force"],
    )  # fmt: skip


if __name__ == "__main__":
    compare.main(example(), __doc__)
