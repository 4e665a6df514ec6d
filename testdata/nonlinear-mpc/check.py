"""How far rows of the tables of random starts are from the same loops computed with more effort.

    python check.py [--raised] INDEX...

The loops are computed again with a tolerance of 1e-10 and all cold starts at every sample; `--raised`: those of
random-starts-raised.csv, whose prices of the state bounds rise with the way to the set point.
"""
import csv
import sys

import numpy as np

from closed_loop import Loop, Nonlinear
from model import R_BALL, Design
from random_starts import DURATION, RAISED_TABLE, TABLE


class Thorough(Nonlinear):
    """Nonlinear MPC from every start that there is, at every sample."""

    def torque(self, x, goal, sample, remaining):
        return self.converge(x, goal, True, all_starts=True)


if __name__ == "__main__":
    options = {"tolerance": 1e-10, "raised": "--raised" in sys.argv}
    with open(RAISED_TABLE if options["raised"] else TABLE) as table:
        rows = list(csv.DictReader(table))
    indices = (int(word) for word in sys.argv[1:] if word != "--raised")
    for row in (rows[index] for index in indices):
        start = [0.0, *(float(row[k]) for k in ("theta0_rad", "phi_dot0_rad_s", "theta_dot0_rad_s"))]
        goal = np.array([float(row["distance_m"]) / R_BALL, 0.0, 0.0, 0.0])
        controller = Thorough(Design(float(row["t_s_s"])), int(row["horizon"]), **options)
        loop = Loop(controller, start, goal, DURATION)
        change = loop.cost / float(row["cost_nonlinear"]) - 1
        print(
            f"{row['index']}: {change:+.1e}, largest excess {loop.largest_excess:.4f}, "
            f"better from cold {loop.better_cold}",
            flush=True,
        )
