"""How large the multipliers of hard state bounds become, over P_jj times the width of the bound and over the root of P_jj
times the cost of a plan that stands still.

An exact penalty needs a price above every multiplier of the hard bounds. Printed: one row per problem
from rest, the plan of the first sample with hard bounds, best of the cold starts; first with the bounds of the tables, then
with one of them narrower.
"""
import numpy as np

from model import Design, Q_DIAGONAL, R_BALL, STATE_BOUND
from program import Problem, best, cold_starts

# The narrower bound: which one, and how wide.
NARROW = [(0, 0.5), (0, 0.3), (0, 0.15), (1, 15.0), (1, 8.0), (2, 2.0), (2, 1.0)]


def row(design, problem, horizon, distance):
    """The ratios of one problem from rest."""
    goal = np.array([distance / R_BALL, 0.0, 0.0, 0.0])
    rest = np.zeros(4)
    starts = cold_starts(design, design.predict, rest, goal, horizon)
    plan = best([problem.solve(rest, goal, start) for start in starts])
    largest = np.abs(plan.bound_multipliers()).max(axis=1)
    slope = np.diag(design.p)[1:]
    still = goal @ design.p @ goal + horizon * Q_DIAGONAL @ goal**2
    of_width, of_way = largest / (slope * 2 * design.state_bound), largest / np.sqrt(slope * still)
    bounds = ",".join(f"{bound:.4g}" for bound in design.state_bound)
    ratios = ",".join(f"{ratio:.4f}" for ratio in [*of_width, *of_way])
    print(f"{design.t_s},{horizon},{distance:g},{bounds},{ratios},{int(plan.converged)}", flush=True)


if __name__ == "__main__":
    states = ("theta", "phi_dot", "theta_dot")
    titles = [f"{what}_{state}" for what in ("bound", "of_width", "of_way") for state in states]
    print("t_s_s,horizon,distance_m," + ",".join(titles) + ",converged")
    for t_s in (0.01, 0.02, 0.03, 0.05):
        design = Design(t_s)
        for horizon in (10, 20, 40, 80):
            problem = Problem(design, design.predict, horizon, soft=False)
            for distance in (1.0, 2.5, 5.0, 10.0):
                row(design, problem, horizon, distance)
    for state, width in NARROW:
        bound = STATE_BOUND.copy()
        bound[state] = width
        for t_s, horizon in ((0.05, 20), (0.05, 60), (0.02, 40)):
            design = Design(t_s, bound)
            problem = Problem(design, design.predict, horizon, soft=False)
            for distance in (2.5, 10.0):
                row(design, problem, horizon, distance)
