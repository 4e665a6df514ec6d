"""For a user of do-mpc: the model that is there already, under both controllers.

The model is a do-mpc `Model` in continuous time, a pendulum with a torque at its joint (1 kg, 1 m). Its
equations are read from the object: nothing is written twice. Needs do-mpc.
"""

import casadi as ca
import do_mpc
import lpvmpc
import numpy as np

# What a user of do-mpc has.
model = do_mpc.model.Model("continuous", "SX")
angle = model.set_variable("_x", "angle")
rate = model.set_variable("_x", "rate")
torque = model.set_variable("_u", "torque")
gravity = model.set_variable("_p", "gravity")
model.set_rhs("angle", rate)
model.set_rhs("rate", gravity * ca.sin(angle) + torque)
model.setup()

theirs = do_mpc.controller.MPC(model)
theirs.settings.n_horizon, theirs.settings.t_step = 30, 0.05
theirs.settings.store_full_solution = False
theirs.settings.supress_ipopt_output()
cost = 10 * angle**2 + rate**2
theirs.set_objective(mterm=10 * cost, lterm=cost + 0.1 * torque**2)
theirs.set_rterm(torque=0.0)
theirs.bounds["lower", "_u", "torque"], theirs.bounds["upper", "_u", "torque"] = -6, 6
theirs.bounds["lower", "_x", "rate"], theirs.bounds["upper", "_x", "rate"] = -0.5, 0.5
theirs.set_uncertainty_values(gravity=np.array([9.81]))
theirs.setup()

# The same with lpvmpc: the model as it is; bounds by name.
plant = lpvmpc.Plant.from_do_mpc(
    model, parameters={"gravity": 9.81}, units={"angle": "rad", "rate": "rad/s", "torque": "N m"},
    bounds={"torque": (-6, 6), "rate": (-0.5, 0.5)}, equilibrium=([0, 0], [0]),
)  # fmt: skip
ours = lpvmpc.Mpc(plant, t_s=0.05, horizon=30, q=[10, 1], r=[0.1], terminal=[100, 10])


def main() -> tuple[float, float]:
    """Prints both closed loops; returns their costs."""
    x0 = np.array([0.5, 0.0])
    theirs.x0 = x0
    theirs.set_initial_guess()
    costs = []
    for name, controller in (
        ("do-mpc", lambda t, x: theirs.make_step(x.reshape(-1, 1)).ravel()), ("lpvmpc", ours),
    ):  # fmt: skip
        run = lpvmpc.simulate(plant, controller, x0, 2, t_s=0.05)
        costs.append(run.cost([10, 1], [0.1]))
        print(f"{name}: cost {costs[-1]:.4f}, {1e3 * np.median(run.step_times):.3f} ms per step, largest "
              f"rate {abs(run['rate']).max():.4f} rad/s, end {run.x[-1].round(4) + 0.0}")  # fmt: skip
    return costs[0], costs[1]


if __name__ == "__main__":
    main()
