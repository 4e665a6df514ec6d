"""For a user of acados: the model that is there already.

Any object with `x`, `u` and `f_expl_expr` (and `p`) does; acados need not be installed. Here it is a stand-in for an
`AcadosModel`: a pendulum on a cart, the model of acados' getting-started example (1 kg, 0.1 kg, 0.8 m), under
the weights, horizon (1 s, 20 stages) and bound (80 N) of that example.
"""

from types import SimpleNamespace

import casadi as ca
import lpvmpc
import numpy as np


def pendulum_on_cart() -> SimpleNamespace:
    """What a user of acados has."""
    position, angle, speed, rate = ca.vertsplit(ca.SX.sym("x", 4))
    force = ca.SX.sym("force")
    cart, ball, length, g = 1.0, 0.1, 0.8, 9.81
    sin, cos = ca.sin(angle), ca.cos(angle)
    mass = cart + ball * sin**2
    pull = ball * length * rate**2 * sin
    model = SimpleNamespace(name="pendulum on cart", x=ca.vertcat(position, angle, speed, rate), u=force)
    model.f_expl_expr = ca.vertcat(
        speed,
        rate,
        (force - pull + ball * g * cos * sin) / mass,
        (force * cos - pull * cos + (cart + ball) * g * sin) / (length * mass),
    )
    model.x_labels, model.u_labels = ["position", "angle", "speed", "rate"], ["force"]
    return model


plant = lpvmpc.Plant.from_acados(
    pendulum_on_cart(), bounds={"force": (-80, 80)}, equilibrium=([0, 0, 0, 0], [0]),
    units={"position": "m", "angle": "rad", "speed": "m/s", "rate": "rad/s", "force": "N"},
)  # fmt: skip
Q, R = [2e3, 2e3, 2e-2, 2e-2], [2e-2]
mpc = lpvmpc.Mpc(plant, t_s=0.05, horizon=20, q=Q, r=R, terminal=Q, substeps=2)


def main() -> lpvmpc.Run:
    """Swings the pendulum up, from hanging, and prints how."""
    run = lpvmpc.simulate(plant, mpc, [0, np.pi, 0, 0], 5)
    print(f"cost {run.cost(Q, R):.0f}, {1e6 * np.median(run.step_times):.0f} us per step, largest force "
          f"{abs(run['force']).max():.1f} N, end {run.x[-1].round(4) + 0.0}")  # fmt: skip
    print("file of the plant:", len(plant.to_json()), "bytes; as Rust:", len(plant.to_rust()), "bytes")
    return run


if __name__ == "__main__":
    main()
