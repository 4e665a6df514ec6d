"""A linear plant: the altitude of a Cessna Citation at 128.2 m/s, with bounds on elevator, its rate, and pitch.

Model and bounds: J. M. Maciejowski, Predictive Control with Constraints, Prentice Hall 2002, section 2.8; the
elevator's rate is the input here, so that it can be bounded.
"""

import casadi as ca
import compare
import lpvmpc
import numpy as np
from problem import Example, Start

# Angle of attack, pitch, pitch rate, altitude, elevator [rad, rad, rad/s, m, rad]; its rate [rad/s].
A = np.array([
    [-1.2822, 0, 0.98, 0, -0.3],
    [0, 0, 1, 0, 0],
    [-5.4293, 0, -1.8366, 0, -17],
    [-128.2, 128.2, 0, 0, 0],
    [0, 0, 0, 0, 0],
])  # fmt: skip
B = np.array([[0.0], [0], [0], [0], [1]])


def example() -> Example:
    plant = lpvmpc.Plant.from_matrices(
        A, B, name="aircraft",
        states=["attack", "pitch", "pitch_rate", "altitude", "elevator"], inputs=["elevator_rate"],
        units={"attack": "rad", "pitch": "rad", "pitch_rate": "rad/s", "altitude": "m", "elevator": "rad",
               "elevator_rate": "rad/s"},
        bounds={"pitch": (-0.349, 0.349), "elevator": (-0.262, 0.262), "elevator_rate": (-0.524, 0.524)},
    )  # fmt: skip
    mpc = lpvmpc.Mpc(plant, t_s=0.25, horizon=40, q=[0, 100, 1, 0.01, 1], r=[10])
    starts = [
        Start(f"{metres} m", np.zeros(5), 15, [0, 0, 0, metres, 0]) for metres in (400, 10, 40, -1000)
    ]
    starts.append(Start("pitched up at the bound", [0.3, 0.34, 0.3, 0, 0.1], 15))
    starts.append(Start("beyond the bound", [0, 0.5, 0, 0, 0], 15))
    x, u = ca.SX.sym("x", 5), ca.SX.sym("u")
    return Example(
        "aircraft", "Aircraft, linear", x, u, ca.DM(A) @ x + ca.DM(B) @ u, mpc, starts,
        show=["altitude", "pitch", "elevator", "elevator_rate"],
    )  # fmt: skip


if __name__ == "__main__":
    compare.main(example(), __doc__)
