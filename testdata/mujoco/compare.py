"""Excites, logs and identifies the robot of `robot.py`, and prints errors beside stated intervals.

    pip install mujoco numpy
    python compare.py path/to/ballbot      # about a minute per log
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
ballbot, folder_of_configs = sys.argv[1], Path(__file__).parent


def told(config, *arguments):
    command = [ballbot, "-q", *map(str, arguments), "--config", folder_of_configs / config, "--json"]
    return json.loads(subprocess.check_output(command))


def errors(found, plane):
    """The errors of a plane's parameters beside the half-widths of their intervals, in per cent."""
    cells = []
    for key, value in robot.truth(plane).items():
        half = 1.96 * found[key]["standard_deviation"]
        cells.append(f"{key} {100 * (found[key]['value'] / value - 1):+.1f} +- {abs(100 * half / value):.1f} %")
    return ", ".join(cells) + f", creep_phi_s {found['creep_phi_s']['value']:.4f}"


with tempfile.TemporaryDirectory() as folder:
    folder = Path(folder)
    design = told("robot.toml", "excite", "--amplitude", 6, "--out", folder / "torque.csv")
    torque = np.loadtxt(folder / "torque.csv", delimiter=",", skiprows=1)[:, 1]
    log, gain = folder / "log.csv", np.array(design["gain"])
    for name, (compliance, floor) in CASES.items():
        for seed in (1, 2):
            excitation = np.column_stack([torque, np.zeros_like(torque)])
            robot.record(log, excitation, gain, compliance, floor, seed)
            found = told("robot.toml", "identify", log, "--out", folder / "out")["parameters"]
            print(f"{name}, seed {seed}: {errors(found, 0)}", flush=True)
            # Both planes move, the plane y half of the log later.
            excitation = np.column_stack([torque, np.roll(torque, len(torque) // 2)])
            robot.record(log, excitation, gain, compliance, floor, seed)
            found = told("both.toml", "identify", log, "--out", folder / "out")
            for plane, own in enumerate("xy"):
                of_plane = found["parameters"] | found["planes"][own]["parameters"]
                print(f"{name}, seed {seed}, both planes, {own}: {errors(of_plane, plane)}", flush=True)
