"""The program `lpvmpc` does what the package does, bit for bit. The variable LPVMPC_PROGRAM has the program's path."""

from __future__ import annotations

import csv
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import lpvmpc


def test_the_closed_loop_of_an_experiment_is_that_of_the_package(tmp_path: Path) -> None:
    program = os.environ.get("LPVMPC_PROGRAM")
    if program is None:
        pytest.skip("LPVMPC_PROGRAM does not name the program lpvmpc")

    def run(*arguments: str) -> str:
        found = subprocess.run(
            [program, *arguments], check=False, capture_output=True, text=True, cwd=tmp_path
        )
        assert found.returncode == 0, found.stderr
        return found.stdout

    (tmp_path / "cart-pole.json").write_text(run("example", "plant"), encoding="utf-8")
    noise = "noise = { tilt = 0.001 }"
    text = run("example").replace(f"# {noise}", noise).replace("duration = 6.0", "duration = 4.0")
    assert f"\n{noise}" in text
    (tmp_path / "cart-pole.toml").write_text(text, encoding="utf-8")
    run("simulate", "cart-pole.toml")
    with (tmp_path / "out" / "cart-pole" / "trajectory.csv").open(encoding="utf-8", newline="") as file:
        _, *rows = list(csv.reader(file))
    x = np.array([[float(cell) for cell in row[1:5]] for row in rows])
    u = np.array([[float(row[5])] for row in rows[:-1]])

    plant = lpvmpc.Plant.load(tmp_path / "cart-pole.json")
    mpc = lpvmpc.Mpc(
        plant, t_s=0.04, horizon=40, q=[10, 10, 0.1, 0.1], r=[0.01], x_bounds={"position": (-0.2, 1.2)}
    )
    found = lpvmpc.simulate(
        plant.with_parameters(pole_mass=0.33),
        mpc,
        x0=[0, 0, 0, 0],
        duration=4.0,
        x_ref=lambda t: [1.0 if t > 0.5 else 0.0, 0, 0, 0],
        sensors={"tilt": lpvmpc.Sensor(noise=0.001)},
        disturbances=[lpvmpc.Jump(3.0, [0, 0, 0, 0.2])],
    )
    assert (found.x == x).all()
    assert (found.u == u).all()
