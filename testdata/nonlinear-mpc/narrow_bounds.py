"""Set points from rest within narrow bounds, with prices that rise with the way: writes narrow-bounds.csv."""
import sys
import time

import numpy as np

from closed_loop import COLUMNS, both, values
from model import R_BALL, Design

DURATION = 6.0
# Bounds of theta, phi_dot, theta_dot and of the torque.
TIGHT = ((0.3, 15.0, 2.0), 0.5)
LEAN = ((0.15, 15.0, 2.0), 0.5)
SLOW = ((1.0, 8.0, 6.0), 1.5)
CALM = ((0.4, 30.0, 1.0), 1.0)
# With t_s, horizon and distance in metres.
CASES = [
    *(
        (TIGHT, 0.05, *case)
        for case in ((20, 5.0), (20, 10.0), (40, 4.0), (60, 3.0), (60, 3.4), (60, 7.0), (80, 10.0))
    ),
    *((LEAN, 0.03, *case) for case in ((30, 2.5), (30, 10.0), (60, 5.0))),
    *((SLOW, 0.05, *case) for case in ((20, 1.5), (40, 5.0))),
    *((CALM, 0.02, *case) for case in ((20, 2.5), (40, 8.0))),
]

if __name__ == "__main__":
    with open("narrow-bounds.csv", "w") as table:
        print(
            "theta_bound_rad,phi_dot_bound_rad_s,theta_dot_bound_rad_s,torque_bound_nm,t_s_s,horizon,distance_m,"
            f"duration_s,{COLUMNS}",
            file=table, flush=True,
        )
        for (state_bound, torque_bound), t_s, horizon, distance in CASES:
            begin = time.monotonic()
            goal = np.array([distance / R_BALL, 0.0, 0.0, 0.0])
            design = Design(t_s, state_bound, torque_bound)
            loops = both(design, horizon, np.zeros(4), goal, DURATION, raised=True)
            row = (*state_bound, torque_bound, t_s, horizon, distance, DURATION, *values(*loops))
            print(*map(repr, row), sep=",", file=table, flush=True)
            taken = time.monotonic() - begin
            print(f"{state_bound} {horizon} {t_s} s {distance} m: {taken:.1f} s", file=sys.stderr)
