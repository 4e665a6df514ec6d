"""The program `lpvmpc` does what the package does, bit for bit. The variable LPVMPC_PROGRAM has the program's path."""

from __future__ import annotations

import csv
import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import lpvmpc


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., str]:
    """Runs the program in a folder that has the example's plant; what it prints."""
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
    return run


def trajectory(folder: Path) -> dict[str, np.ndarray]:
    """The columns of a run, by name."""
    with (folder / "trajectory.csv").open(encoding="utf-8", newline="") as file:
        names, *rows = list(csv.reader(file))
    columns = zip(names, zip(*rows, strict=True), strict=True)
    return {name.split(" [")[0]: np.array([float(one) for one in cells if one]) for name, cells in columns}


def test_the_closed_loop_of_an_experiment_is_that_of_the_package(tmp_path: Path, run: Callable[..., str]) -> None:
    noise = "noise = { tilt = 0.001 }"
    text = run("example").replace(f"# {noise}", noise).replace("duration = 6.0", "duration = 4.0")
    assert f"\n{noise}" in text
    (tmp_path / "cart-pole.toml").write_text(text, encoding="utf-8")
    run("simulate", "cart-pole.toml")
    table = trajectory(tmp_path / "out" / "cart-pole")

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
    for signal in (*plant.states, *plant.inputs):
        assert (found[signal.name] == table[signal.name]).all()


@pytest.mark.parametrize("delay", [0.0, 0.06, 0.08])
def test_behind_readings_it_is_that_of_the_package(
    tmp_path: Path, run: Callable[..., str], delay: float
) -> None:
    # Half a sample of delay, too; readings whose order is not that of their names, and one after which none is for a
    # while: the blow at 3 s is an outlier at first.
    experiment = f"""
name = "estimated"
plant = "cart-pole.json"
x0 = [0.0, 0.05, 0.0, 0.0]
duration = 5.0
[controller]
t_s = 0.04
horizon = 40
q = [20, 10, 0.1, 0.1]
r = [0.01]
u_bounds = {{ force = [-12.0, 12.0] }}
[controller.estimator]
measured = {{ tilt = 1e-6, position = 1e-6 }}
state_noise = {{ position = 1e-6, tilt = 1e-6, speed = 1e-3, rate = 1e-3 }}
initial_state = [0.1, 0.1, 0.2, 0.1]
disturbances = {{ force = {{ noise = 0.1 }}, rate = {{ noise = 0.01, initial = 0.5 }} }}
start = [0.0, 0.02, 0.0, 0.0]
delay = {delay}
gate = {{ deviations = 8.0, patience = 3, longest_gap = 1.0 }}
[[reference]]
time = 0.0
x = [0.0, 0.0, 0.0, 0.0]
[[reference]]
time = 1.3
x = [0.4, 0.0, 0.0, 0.0]
[world]
parameters = {{ pole_mass = 0.36 }}
delay = {delay}
noise = {{ position = 1e-3, tilt = 2e-3 }}
seed = 7
[[world.load]]
start = 0.5
end = inf
load = [0.0, 0.0, 0.8, -1.2]
[[world.jump]]
time = 3.0
change = [0.0, 0.05, 0.0, 0.0]
"""
    (tmp_path / "estimated.toml").write_text(experiment, encoding="utf-8")
    run("simulate", "estimated.toml")
    table = trajectory(tmp_path / "out" / "estimated")

    plant = lpvmpc.Plant.load(tmp_path / "cart-pole.json")
    estimator = lpvmpc.Estimator(
        measured={"tilt": 1e-6, "position": 1e-6},
        state_noise={"position": 1e-6, "tilt": 1e-6, "speed": 1e-3, "rate": 1e-3},
        initial_state=[0.1, 0.1, 0.2, 0.1],
        disturbances={"force": lpvmpc.Disturbance(0.1), "rate": lpvmpc.Disturbance(0.01, 0.5)},
        start=[0, 0.02, 0, 0],
        delay=delay,
        gate=lpvmpc.Gate(deviations=8.0, patience=3, longest_gap=1.0),
    )
    mpc = lpvmpc.Mpc(
        plant, 0.04, 40, [20, 10, 0.1, 0.1], [0.01], u_bounds={"force": (-12, 12)}, estimator=estimator
    )
    found = lpvmpc.simulate(
        plant.with_parameters(pole_mass=0.36),
        mpc,
        x0=[0, 0.05, 0, 0],
        duration=5.0,
        x_ref=lambda t: [0.4 if t > 1.3 - 1e-6 else 0.0, 0, 0, 0],
        sensors={"position": lpvmpc.Sensor(noise=1e-3), "tilt": lpvmpc.Sensor(noise=2e-3)},
        delay=delay,
        disturbances=[lpvmpc.Load(0.5, np.inf, [0, 0, 0.8, -1.2]), lpvmpc.Jump(3.0, [0, 0.05, 0, 0])],
        seed=7,
    )
    assert found.is_solved
    for signal in (*plant.states, *plant.inputs):
        assert (found[signal.name] == table[signal.name]).all(), signal.name
    for i, state in enumerate(plant.states):
        assert (found.x_measured[:, i] == table[f"{state.name} estimate"]).all()
        assert (found.x_ref[:, i] == table[f"{state.name} reference"]).all()
    for name, values in found.disturbances.items():
        assert (values == table[f"{name} disturbance"]).all()
    assert abs(found.disturbances["force"]).max() > 0.3
