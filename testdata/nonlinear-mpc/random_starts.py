"""Random horizons, sampling times, set points and starts: appends to random-starts.csv.

    python random_starts.py [--raised] [COUNT]

With --raised the prices of the state bounds rise with the way to the set point, as in scenarios, and the table is
random-starts-raised.csv.

The cases follow from the seed alone and are written in order. A table that was left in the middle
goes on where it ends, up to COUNT rows (1000 without it).
"""
import math
import os
import sys
import time

import numpy as np

from closed_loop import COLUMNS, both, values
from model import R_BALL, Design

SEED = 20251
COUNT = 1000
DURATION = 8.0
TABLE = "random-starts.csv"
RAISED_TABLE = "random-starts-raised.csv"


def cases():
    """(horizon, t_s, distance, theta0, phi_dot0, theta_dot0), endlessly, with a fixed seed."""
    generator = np.random.default_rng(SEED)

    def between(low, high):
        return float(generator.uniform(low, high))

    while True:
        yield (
            int(generator.integers(10, 80, endpoint=True)),
            round(between(0.010, 0.050), 3),
            math.copysign(math.exp(between(math.log(0.2), math.log(10.0))), between(-1.0, 1.0)),
            between(-math.pi / 4, math.pi / 4),
            between(-4.0, 4.0),
            between(-4.0, 4.0),
        )


if __name__ == "__main__":
    words = sys.argv[1:]
    raised = "--raised" in words
    counts = [int(word) for word in words if word != "--raised"]
    count = counts[0] if counts else COUNT
    path = RAISED_TABLE if raised else TABLE
    done = 0
    if os.path.exists(path):
        with open(path) as table:
            done = sum(1 for _ in table) - 1
    with open(path, "a") as table:
        if table.tell() == 0:
            print(
                "index,horizon,t_s_s,distance_m,theta0_rad,phi_dot0_rad_s,theta_dot0_rad_s,"
                f"duration_s,{COLUMNS}",
                file=table, flush=True,
            )
            done = 0
        for index, case in zip(range(count), cases()):
            if index < done:
                continue
            begin = time.monotonic()
            horizon, t_s, distance, *start = case
            goal = np.array([distance / R_BALL, 0.0, 0.0, 0.0])
            loops = both(Design(t_s), horizon, np.array([0.0, *start]), goal, DURATION, raised=raised)
            row = (index, *case, DURATION, *values(*loops))
            print(*map(repr, row), sep=",", file=table, flush=True)
            print(f"{index} {horizon} {t_s}: {time.monotonic() - begin:.1f} s", file=sys.stderr)
