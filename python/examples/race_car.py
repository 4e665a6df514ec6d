"""A 1:43 race car, a bicycle with the tyres of Pacejka, on a figure of eight.

Model and numbers: A. Liniger, A. Domahidi, M. Morari, Optimization-based autonomous racing of 1:43 scale RC cars,
Optimal Control Applications and Methods 36(5), 2015.
"""

import casadi as ca
import compare
import lpvmpc
import numpy as np
from problem import Example, Start

MASS, INERTIA, FRONT, REAR = 0.041, 27.8e-6, 0.029, 0.033  # kg, kg m^2, m, m
MOTOR, DAMPING, ROLLING, DRAG = 0.287, 0.0545, 0.0518, 0.00035
TYRES = {"front": (2.579, 1.2, 0.192), "rear": (3.3852, 1.2691, 0.1737)}  # B, C, D
T_S = 0.02  # s


def eight(period: float, scale: float = 1.0):
    """The reference: places, heading, speed and yaw rate of a figure of eight by time."""

    def reference(t: float) -> list[float]:
        w = 2 * np.pi / period
        dx, dy = w * np.cos(w * t), 0.9 * w * np.cos(2 * w * t)
        ddx, ddy = -(w**2) * np.sin(w * t), -1.8 * w**2 * np.sin(2 * w * t)
        speed, yaw_rate = np.hypot(dx, dy), (dx * ddy - dy * ddx) / (dx**2 + dy**2)
        # On the eight the heading stays within 0.74 pi of -pi/2: no jump by a turn.
        heading = (np.arctan2(dy, dx) + 1.5 * np.pi) % (2 * np.pi) - 1.5 * np.pi
        return [scale * np.sin(w * t), 0.45 * scale * np.sin(2 * w * t), heading, scale * speed, 0, yaw_rate]

    return reference


def draw(axes, run) -> None:
    """The path beside the reference."""
    axes.plot(*run.x_ref[:, :2].T, color="#D55E00", lw=1.1, ls="--", label="reference")
    axes.plot(run["x"], run["y"], color="#0072B2", lw=1.4)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.legend(frameon=False, fontsize="small", loc="upper center")


def example() -> Example:
    x, u = ca.SX.sym("x", 6), ca.SX.sym("u", 2)  # place, heading, speeds ahead and aside, yaw rate
    heading, ahead, aside, yaw, (duty, steering) = x[2], x[3], x[4], x[5], (u[0], u[1])

    def side_force(tyre: str, slip):
        b, c, d = TYRES[tyre]
        return d * ca.sin(c * ca.atan(b * slip))

    front = side_force("front", steering - ca.atan2(aside + FRONT * yaw, ahead))
    rear = side_force("rear", -ca.atan2(aside - REAR * yaw, ahead))
    drive = (MOTOR - DAMPING * ahead) * duty - ROLLING - DRAG * ahead**2
    xdot = ca.vertcat(
        ahead * ca.cos(heading) - aside * ca.sin(heading),
        ahead * ca.sin(heading) + aside * ca.cos(heading),
        yaw,
        (drive - front * ca.sin(steering)) / MASS + aside * yaw,
        (rear + front * ca.cos(steering)) / MASS - ahead * yaw,
        (front * FRONT * ca.cos(steering) - rear * REAR) / INERTIA,
    )
    plant = lpvmpc.Plant.from_casadi(
        x, u, xdot, name="race car",
        states=["x", "y", "heading", "ahead", "aside", "yaw_rate"], inputs=["duty", "steering"],
        units={"x": "m", "y": "m", "heading": "rad", "ahead": "m/s", "aside": "m/s", "yaw_rate": "rad/s",
               "steering": "rad"},
        bounds={"ahead": (0.3, 3.5), "duty": (-0.1, 1), "steering": (-0.35, 0.35)},
    )  # fmt: skip
    q = np.array([100, 100, 1, 1, 0.01, 0.01])
    mpc = lpvmpc.Mpc(plant, T_S, 40, q=q, r=[0.1, 1], terminal=10 * q, substeps=2)
    rest, start = [0.2, 0], np.array(eight(4.5)(0))
    starts = [
        Start("1.5 m/s", start, 9, eight(4.5), rest),
        Start("1 m/s", eight(7)(0), 7, eight(7), rest),
        Start("too fast", eight(3)(0), 6, eight(3), rest),
        Start("0.2 m aside", start + [0.15, -0.15, 0, 0, 0, 0], 3, eight(4.5), rest),
        Start("slow, turned by 0.8 rad", start + [0, 0, 0.8, -0.9, 0, 0], 3, eight(4.5), rest),
        Start("sliding", start + [0, 0, -0.5, 0, 0.6, 4], 3, eight(4.5), rest),
    ]
    return Example(
        "race_car", "1:43 race car", x, u, xdot, mpc, starts,
        show=["ahead", "aside", "yaw_rate", "duty", "steering"], path=draw,
    )  # fmt: skip


if __name__ == "__main__":
    compare.main(example(), __doc__)
