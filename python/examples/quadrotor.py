"""A planar quadrotor that flies through a gap in a wall.

Model and numbers: R. Tedrake, Underactuated Robotics, chapter 3 (the planar quadrotor; mass, arm and inertia
of J. Steinhardt, R. Tedrake, Finite-time regional verification of stochastic non-linear systems, International
Journal of Robotics Research 31(7), 2012). The wall is a corridor by sample: before, in and behind the gap.
"""

import casadi as ca
import compare
import lpvmpc
import numpy as np
from problem import Example, Start

MASS, ARM, INERTIA, G = 0.486, 0.25, 0.00383, 9.81  # kg, m, kg m^2, m/s^2
WALL, GAP, MARGIN, T_S = (1.6, 2.0), (0.8, 1.4), 0.1, 0.05  # m, m, m, s
ENTER, LEAVE = 20, 28  # samples
HOVER = [MASS * G / 2] * 2
LIMITS = np.array([[-1, -0.5, -1.2, -5, -5, -10], [6, 3, 1.2, 5, 5, 10]])


def corridor() -> tuple[np.ndarray, np.ndarray]:
    """Bounds by sample: in front of the wall, in the gap, behind the wall."""
    lower, upper = (np.tile(one, (LEAVE + 2, 1)) for one in LIMITS.astype(float))
    upper[:ENTER, 0] = WALL[0] - MARGIN
    lower[ENTER - 1 : LEAVE + 1, 1], upper[ENTER - 1 : LEAVE + 1, 1] = GAP[0] + MARGIN, GAP[1] - MARGIN
    lower[LEAVE:, 0] = WALL[1] + MARGIN
    return lower, upper


def draw(axes, run) -> None:
    """The path in the plane, and the quadrotor on it."""
    for low, high in ((-0.5, GAP[0]), (GAP[1], 3.0)):
        axes.fill_between(WALL, low, high, color="#7f7f7f", alpha=0.45, lw=0)
    axes.plot(run["x"], run["z"], color="#0072B2", lw=1.4)
    for x, z, pitch in run.x[::3, :3]:
        dx, dz = 0.5 * ARM * np.cos(pitch), 0.5 * ARM * np.sin(pitch)
        axes.plot([x - dx, x + dx], [z - dz, z + dz], color="#D55E00", lw=2, solid_capstyle="round")
    axes.set(xlabel="x [m]", ylabel="z [m]", ylim=(-0.2, 2.0), xlim=(-0.3, 4.4), aspect="equal")


def example() -> Example:
    x, u = ca.SX.sym("x", 6), ca.SX.sym("u", 2)  # x, z, pitch, their rates; thrusts
    thrust = (u[0] + u[1]) / MASS
    xdot = ca.vertcat(
        x[3:], -thrust * ca.sin(x[2]), thrust * ca.cos(x[2]) - G, ARM * (u[0] - u[1]) / INERTIA
    )
    states = ["x", "z", "pitch", "x_rate", "z_rate", "pitch_rate"]
    plant = lpvmpc.Plant.from_casadi(
        x, u, xdot, name="quadrotor", states=states, inputs=["right", "left"],
        units=dict(zip([*states, "right", "left"], ["m", "m", "rad", "m/s", "m/s", "rad/s", "N", "N"])),
        bounds={**dict(zip(states, LIMITS.T.tolist())), "right": (0, 6), "left": (0, 6)},
        equilibrium=([0] * 6, HOVER),
    )  # fmt: skip
    mpc = lpvmpc.Mpc(plant, T_S, 30, q=[10, 10, 1, 0.5, 0.5, 0.1], r=[0.1, 0.1])
    there, here = [4, 0.2, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0]
    starts = [
        Start("through the gap", here, 4, there, HOVER, corridor()),
        Start("from above", [0, 2, 0, 0, 0, 0], 4, there, HOVER, corridor()),
        Start("4 m aside", here, 4, [4, 0, 0, 0, 0, 0], HOVER),
        Start("tilted by 1 rad", [0, 1, 1.0, 0, 0, 0], 4, [0, 1, 0, 0, 0, 0], HOVER),
        Start("falling and turning", [0, 2, 0.5, 0, -3, 5], 4, [0, 1, 0, 0, 0, 0], HOVER),
    ]
    random = np.random.default_rng(5)
    for i in range(5):
        x0 = random.uniform([0, 1, -1, -2, -2, -5], [3, 2.5, 1, 2, 2, 5])
        starts.append(Start(f"random {i}", x0, 4, [random.uniform(0, 5), 1.5, 0, 0, 0, 0], HOVER))
    return Example(
        "quadrotor", "Planar quadrotor through a gap", x, u, xdot, mpc, starts,
        show=["x", "z", "pitch", "right", "left"], path=draw,
    )  # fmt: skip


if __name__ == "__main__":
    compare.main(example(), __doc__)
