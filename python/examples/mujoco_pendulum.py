"""MuJoCo's InvertedPendulum-v5 moved and stood up: physics that is not the model.

The model is a cart-pole with the masses, inertia, damping and gear that MuJoCo has of the environment's file
(E. Todorov, T. Erez, Y. Tassa, MuJoCo: A physics engine for model-based control, IROS 2012; M. Towers and others,
Gymnasium, 2024). MuJoCo integrates it with contacts at the track's ends. Needs gymnasium[mujoco].
"""

import argparse
from pathlib import Path

import casadi as ca
import lpvmpc
import numpy as np
from problem import Example, Start
from references import Converged

CART, POLE, HALF, INERTIA, DAMPING, GEAR = 10.47197551, 5.01859164, 0.3, 0.18874977, 1.0, 100.0
G, T_S = 9.81, 0.04  # m/s^2, s


def example() -> Example:
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")  # position, angle from upright, their rates; motor, 100 N
    sin, cos, lever = ca.sin(x[1]), ca.cos(x[1]), POLE * HALF
    a, b, c = CART + POLE, lever * cos, INERTIA + POLE * HALF**2
    cart = GEAR * u - DAMPING * x[2] + lever * x[3] ** 2 * sin
    pole = lever * G * sin - DAMPING * x[3]
    det = a * c - b * b
    xdot = ca.vertcat(x[2], x[3], (c * cart - b * pole) / det, (a * pole - b * cart) / det)
    plant = lpvmpc.Plant.from_casadi(
        x, u, xdot, name="InvertedPendulum-v5",
        states=["position", "angle", "speed", "rate"], inputs=["motor"],
        units={"position": "m", "angle": "rad", "speed": "m/s", "rate": "rad/s", "motor": "100 N"},
        bounds={"position": (-0.9, 0.9), "angle": (-1.5, 1.5), "motor": (-3, 3)},
        equilibrium=([0, 0, 0, 0], [0]),
    )  # fmt: skip
    mpc = lpvmpc.Mpc(plant, T_S, 30, q=[10, 1, 0.1, 0.1], r=[0.1], substeps=2)
    starts = [
        Start("end to end", [-0.85, 0, 0, 0], 3, [0.85, 0, 0, 0]),
        Start("leaning by 0.5 rad", [0.3, 0.5, 0, 0], 3, [0, 0, 0, 0]),
        Start("leaning by 0.8 rad", [-0.85, 0.8, 0, 0], 4, [0, 0, 0, 0]),
        Start("hit", [0, 0, -0.5, 5], 3, [0.5, 0, 0, 0]),
    ]
    return Example(
        "mujoco_pendulum", "MuJoCo's InvertedPendulum-v5", x, u, xdot, mpc, starts,
        show=["position", "angle", "motor"],
    )  # fmt: skip


def in_mujoco(environment, start: Start, control) -> tuple[np.ndarray, np.ndarray]:
    """States (K + 1, 4) and inputs (K, 1) of the closed loop."""
    environment.reset(seed=0)
    environment.unwrapped.set_state(np.array(start.x0[:2], float), np.array(start.x0[2:], float))
    states, inputs = [np.array(start.x0, float)], []
    for i in range(round(start.duration / T_S)):
        inputs.append(np.array(control(i * T_S, states[-1])))
        states.append(environment.step(inputs[-1])[0])
    return np.array(states), np.array(inputs)


def main() -> None:
    import gymnasium

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", default="out")
    folder = Path(parser.parse_args().folder)
    folder.mkdir(parents=True, exist_ok=True)
    made, environment = example(), gymnasium.make("InvertedPendulum-v5", max_episode_steps=10_000)
    mpc, converged, q = made.mpc, Converged(made), np.array(made.mpc.settings["q"])
    for i, start in enumerate(made.starts):
        mpc.reset()
        runs = [
            in_mujoco(environment, start, lambda t, x: mpc.step(x, start.x_ref).u0),
            in_mujoco(environment, start, converged.controller(made, start)),
        ]
        costs = [((x[:-1] - start.x_ref) ** 2 @ q).sum() + 0.1 * (u**2).sum() for x, u in runs]
        x, u = runs[0]
        print(f"{start.name:20} cost {costs[0]:8.2f}, of IPOPT's {costs[0] / costs[1]:.4f}; largest "
              f"position {abs(x[:, 0]).max():.4f} m; end {np.round(x[-1], 4) + 0.0}")  # fmt: skip
        if i == 0:
            run = lpvmpc.Run(
                mpc.plant, T_S * np.arange(len(x)), x, u, np.zeros((len(u), 0)), x[:-1],
                np.tile(start.x_ref, (len(u), 1)), bounds=mpc.bounds,
            )  # fmt: skip
            run.plot(made.show).savefig(folder / f"{made.name}.png", dpi=130)


if __name__ == "__main__":
    main()
