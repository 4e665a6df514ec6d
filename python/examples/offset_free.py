"""Four tanks whose pumps give 10 % less than the model says, with a leak: tracked without offset.

What the model misses from one sample to the next is taken as a disturbance of f, smoothed, and told to the
controller; the steady state that it is sent to is that under the disturbance (K. R. Muske, T. A. Badgwell,
Disturbance modeling for offset-free linear model predictive control, Journal of Process Control 12(5), 2002). The
plant and its source are those of four_tanks.py.
"""

import argparse
from pathlib import Path

import four_tanks
import lpvmpc
import numpy as np

LEVELS = np.array([15.0, 11.0])  # cm, of the lower tanks
LEAK = lpvmpc.Load(300, np.inf, [-0.02, 0, 0, 0])  # cm/s, from 300 s on
FORGET = 0.3  # part of what the model misses that is believed at each sample


def real_plant() -> lpvmpc.Plant:
    """The tanks with weaker pumps: the model's input times 0.9."""
    import casadi as ca

    model = four_tanks.example()
    weaker = ca.substitute(model.xdot, model.u, 0.9 * model.u)
    return lpvmpc.Plant.from_casadi(
        model.x, model.u, weaker, states=[one.name for one in model.mpc.plant.states],
        inputs=["pump_1", "pump_2"],
        units={one.name: one.unit for one in (*model.mpc.plant.states, *model.mpc.plant.inputs)},
    )  # fmt: skip


def run(estimate: bool, duration: float = 600) -> lpvmpc.Run:
    """The closed loop, with or without an estimate of the disturbance."""
    model = four_tanks.example()
    mpc, disturbance, expected = model.mpc, np.zeros(4), None

    def control(t: float, x: np.ndarray) -> np.ndarray:
        nonlocal disturbance, expected
        if estimate and expected is not None:
            disturbance = disturbance + FORGET * (x - expected) / mpc.t_s
        x_ref, u_ref = four_tanks.steady(LEVELS, disturbance)
        plan = mpc.step(x, x_ref, u_ref=u_ref, disturbance=disturbance)
        expected = plan.x[1]
        return plan.u0

    target = four_tanks.steady(LEVELS)[0]
    return lpvmpc.simulate(
        real_plant(), control, model.starts[0].x0, duration, target, t_s=mpc.t_s, disturbances=[LEAK]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", default="out")
    folder = Path(parser.parse_args().folder)
    folder.mkdir(parents=True, exist_ok=True)
    for estimate in (False, True):
        made = run(estimate)
        before, after = (made.x[i, :2] - LEVELS for i in (59, -1))
        print(f"estimate {estimate}: off by {before.round(4)} cm before the leak, {after.round(4)} cm with it")
    made.plot(["level_1", "level_2", "pump_1", "pump_2"]).savefig(folder / "offset_free.png", dpi=130)


if __name__ == "__main__":
    main()
