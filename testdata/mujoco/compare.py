"""Excites, logs and identifies the robot of `robot.py`, and prints errors beside stated intervals.

    pip install mujoco numpy
    python compare.py path/to/ballbot      # about a minute per row
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import robot

STIFF = 'solref="0.002 1" solimp="0.99 0.999 0.0001"', 100
CASES = {  # compliance of the wheels' contacts in m/s per N, and the floor
    "stiff": (1e-6, STIFF),
    "MuJoCo's default floor": (1e-6, ("", 1)),
    "wheels 1e-4": (1e-4, STIFF),
    "wheels 5e-4, default floor": (5e-4, ("", 1)),
}
ballbot, config = sys.argv[1], Path(__file__).with_name("robot.toml")


def told(*arguments):
    return json.loads(subprocess.check_output([ballbot, "-q", *map(str, arguments), "--config", config, "--json"]))


with tempfile.TemporaryDirectory() as folder:
    folder = Path(folder)
    design = told("excite", "--amplitude", 6, "--out", folder / "torque.csv")
    excitation = np.loadtxt(folder / "torque.csv", delimiter=",", skiprows=1)[:, 1]
    for name, (compliance, floor) in CASES.items():
        for seed in (1, 2):
            log = folder / "log.csv"
            robot.record(log, excitation, np.array(design["gain"]), compliance, floor, seed)
            found = told("identify", log, "--out", folder / "out")["parameters"]
            cells = []
            for key, value in robot.truth().items():
                half = 1.96 * found[key]["standard_deviation"]
                cells.append(f"{key} {100 * (found[key]['value'] / value - 1):+.1f} +- {100 * half / value:.1f} %")
            print(f"{name}, seed {seed}: " + ", ".join(cells) + f", creep_phi_s {found['creep_phi_s']['value']:.4f}", flush=True)
