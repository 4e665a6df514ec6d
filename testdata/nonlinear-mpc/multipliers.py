"""How large the multipliers of hard state bounds become, over P_jj times the width of the bound.

An exact penalty needs a price above every multiplier of the hard bounds. Printed: one row per problem
from rest, the plan of the first sample with hard bounds, best of the cold starts.
"""
import numpy as np

from model import Design, R_BALL, STATE_BOUND
from program import Problem, best, cold_starts

if __name__ == "__main__":
    print("t_s_s,horizon,distance_m,ratio_theta,ratio_phi_dot,ratio_theta_dot,converged")
    for t_s in (0.01, 0.02, 0.03, 0.05):
        design = Design(t_s)
        unit = np.diag(design.p)[1:] * 2 * STATE_BOUND
        for horizon in (10, 20, 40, 80):
            problem = Problem(design, design.predict, horizon, soft=False)
            for distance in (1.0, 2.5, 5.0, 10.0):
                goal = np.array([distance / R_BALL, 0.0, 0.0, 0.0])
                rest = np.zeros(4)
                starts = cold_starts(design, design.predict, rest, goal, horizon)
                plan = best([problem.solve(rest, goal, start) for start in starts])
                ratio = np.abs(plan.bound_multipliers()).max(axis=1) / unit
                print(
                    f"{t_s},{horizon},{distance:g}," + ",".join(f"{r:.4f}" for r in ratio)
                    + f",{int(plan.converged)}",
                    flush=True,
                )
