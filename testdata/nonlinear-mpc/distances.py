"""Set points at several distances, from rest: writes distances.csv."""
import sys
import time

import numpy as np

from closed_loop import COLUMNS, both, values
from model import R_BALL, Design

DURATION = 12.0
CASES = [
    (0.05, (10, 20, 40, 60, 80), (0.2, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 5.0, 7.5, 10.0)),
    (0.02, (20, 40, 80), (0.2, 0.5, 1.0, 2.5, 5.0, 10.0)),
    (0.01, (20, 40, 80), (0.2, 0.5, 1.0, 2.5, 5.0, 10.0)),
]

if __name__ == "__main__":
    with open("distances.csv", "w") as table:
        print(f"horizon,t_s_s,distance_m,duration_s,{COLUMNS}", file=table, flush=True)
        for t_s, horizons, distances in CASES:
            for horizon in horizons:
                for distance in distances:
                    begin = time.monotonic()
                    goal = np.array([distance / R_BALL, 0.0, 0.0, 0.0])
                    loops = both(Design(t_s), horizon, np.zeros(4), goal, DURATION)
                    row = (horizon, t_s, distance, DURATION, *values(*loops))
                    print(*map(repr, row), sep=",", file=table, flush=True)
                    taken = time.monotonic() - begin
                    print(f"{horizon} {t_s} s {distance} m: {taken:.1f} s", file=sys.stderr)
