"""The package says what the program `ballbot` says, bit for bit. The variable LPVMPC_BALLBOT has the program's path."""

from __future__ import annotations

import csv
import json
import math
import os
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lpvmpc import ballbot

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"

Program = Callable[..., str]


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Program:
    path = os.environ.get("LPVMPC_BALLBOT")
    if path is None:
        pytest.skip("LPVMPC_BALLBOT does not name the program ballbot")
    # What was proved once is proved again.
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> str:
        found = subprocess.run([path, *arguments], check=False, capture_output=True, text=True)
        assert found.returncode == 0, found.stderr
        return found.stdout

    return run


def table(path: str) -> dict[str, list[str]]:
    """The columns of a CSV file."""
    with Path(path).open(encoding="utf-8", newline="") as file:
        header, *rows = list(csv.reader(file))
    return {name: [row[i] for row in rows] for i, name in enumerate(header)}


def shown(values: Iterable[Any]) -> list[str]:
    """Values as they stand in a CSV file: numbers in as few digits as give the same bits again."""
    return [cell(value) for value in values]


def cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, (bool, np.bool_)):
        return str(bool(value)).lower()
    if isinstance(value, (float, np.floating)):
        return "" if math.isnan(value) else repr(float(value))
    return str(value)


def same(texts: list[str], values: Iterable[Any]) -> None:
    """The same numbers, to the bit, and the same words."""
    values = shown(values)
    assert len(texts) == len(values)
    for text, value in zip(texts, values, strict=True):
        try:
            number = float(text)
        except ValueError:
            assert text == value
        else:
            assert math.copysign(1.0, number) == math.copysign(1.0, float(value))
            assert number == float(value)


def without_times(metrics: dict[str, Any]) -> dict[str, Any]:
    return {name: one for name, one in metrics.items() if not name.endswith("_step_us")}


@pytest.mark.parametrize(
    ("scenario", "changes"),
    [
        ("two-setpoints", {"controller.horizon": 30, "bounds.torque_nm.1": 0.9}),
        ("far-setpoints", {"duration_s": 2.0}),
        ("lissajous", {"duration_s": 20.0}),
        (str(EXAMPLES / "push-and-move.toml"), {}),
    ],
)
def test_runs(program: Program, scenario: str, changes: dict[str, Any]) -> None:
    sets = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
    said = json.loads(program("simulate", scenario, *sets, "--out", "out", "--log", "log.csv", "--json"))
    loaded = ballbot.Scenario.load(scenario)
    loaded.update(changes)
    run = loaded.simulate()
    assert said["title"] == run.title and said["samples"] == run.samples
    assert [without_times(one) for one in said["planes"]] == [without_times(one.metrics) for one in run.planes]
    for plane in run.planes:
        suffix = f"_{plane.name}" if plane.name else ""
        columns = table(f"out/trajectory{suffix}.csv")
        same(columns["t_s"], plane.t)
        names = ("phi_rad", "theta_rad", "phi_dot_rad_s", "theta_dot_rad_s")
        for i, name in enumerate(names):
            same(columns[name], plane.state[:, i])
            same(columns[f"gap_{name}"][:-1], plane.gap[:, i])
        same(columns["phi_ref_rad"], plane.reference[:, 0])
        same(columns["torque_nm"][:-1], plane.input)
        same(columns["cost"][:-1], plane.cost)
        assert tuple(columns["status"][:-1]) == plane.status
        if plane.decision:
            assert tuple(columns["decision"][:-1]) == plane.decision
            same(columns["artificial_set_point_rad"][:-1], plane.set_point)
        log = f"log-{plane.name}.csv" if plane.name else "log.csv"
        assert Path(log).read_text(encoding="utf-8") == plane.log.csv
    if run.motors is not None:
        columns = table("out/motors.csv")
        for i in range(3):
            same(columns[f"motor_{i + 1}_nm"], run.motors.torque[:, i])
        same(columns["heading_rad"], run.motors.heading)


CAMPAIGN = {
    "title": "Delay and noise that the controller does not know of",
    "scenario": str(EXAMPLES / "push-and-move.toml"),
    "runs": 40,
    "seed": 3,
    "design": "sobol",
    "set": {"duration_s": 2.0},
    "vary": [
        {"key": "world.delay.transport_s", "uniform": [0.0, 0.05]},
        {"key": ["world.robot.b1_factor", "world.robot.b3_factor"], "normal": {"mean": 1.0, "deviation": 0.1}},
        {"key": "controller.horizon", "list": [40, 60]},
    ],
    "success": {"largest_tilt_rad": {"at_most": 0.04}},
}


def campaign_file(changes: dict[str, Any]) -> str:
    """`CAMPAIGN` with changes, as a file."""
    lines = []
    for key, value in (CAMPAIGN | changes).items():
        if value is not None:
            lines.append(f"{key} = {inline(value)}")
    path = Path("campaign.toml")
    path.write_text("\n".join(lines), encoding="utf-8")
    return str(path)


def inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {inline(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(inline, value)) + "]"
    return json.dumps(value)


def test_a_campaign(program: Program) -> None:
    path = campaign_file({})
    program("campaign", path, "--out", "out", "--threads", "1")
    columns = table("out/runs.csv")
    summary = json.loads(Path("out/summary.json").read_text(encoding="utf-8"))
    del summary["folder"]
    for found in (ballbot.campaign(path), ballbot.campaign(CAMPAIGN, threads=2)):
        assert list(columns) == list(found.columns)
        for name, texts in columns.items():
            same(texts, found[name])
        assert summary == found.summary
    assert 0 < summary["failures"] < 40, "the campaign tells runs apart"


def test_a_rare_failure(program: Program) -> None:
    changes = {
        "scenario": "two-setpoints",
        "set": {"duration_s": 0.3},
        "vary": [{"key": "initial_state.theta_rad", "normal": {"mean": 0.0, "deviation": 0.1}}],
        "rare": {"measure": "largest_tilt_rad", "above": 0.3, "level_runs": 100, "least": 1e-4},
    }
    path = campaign_file(changes | dict.fromkeys(["runs", "success", "design"]))
    program("campaign", path, "--out", "out")
    said = json.loads(Path("out/summary.json").read_text(encoding="utf-8"))
    found = ballbot.campaign(path)
    for key in ("probability", "runs", "levels"):
        assert said[key] == found.summary[key]
    points = table("out/failures.csv")
    assert list(points) == list(found.columns)
    for name, texts in points.items():
        same(texts, found[name])


def test_an_identification(program: Program) -> None:
    asked = ballbot.excite(amplitude=0.3, length=10.0)
    program("excite", "--amplitude", "0.3", "--length", "10", "--out", "torque.csv")
    assert Path("torque.csv").read_text(encoding="utf-8") == asked.csv
    scenario = ballbot.Scenario.builtin("one-metre")
    scenario.update({
        "duration_s": 10.0, "world.excitation": "torque.csv", "world.sensors.phi.noise_rad": 1e-3,
        "world.sensors.theta.noise_rad": 1e-3, "world.sensors.theta_dot.noise_rad_s": 5e-3,
    })  # fmt: skip
    run = scenario.simulate()
    Path("log.csv").write_text(run.planes[0].log.csv, encoding="utf-8")
    said = json.loads(program("identify", "log.csv", "--out", "out", "--json"))
    log = run.planes[0].log
    columns = {
        "t_s": log.t, "phi_rad": log.readings[:, 0], "theta_rad": log.readings[:, 1],
        "theta_dot_rad_s": log.readings[:, 3], "torque_commanded_nm": log.commanded,
        "torque_applied_nm": log.applied,
    }  # fmt: skip
    different = {"logs", "folder", "files"}
    for recording in (columns, "log.csv"):
        robot = ballbot.identify([recording])
        assert robot.is_usable
        assert {k: v for k, v in said.items() if k not in different} == {
            k: v for k, v in robot.summary.items() if k not in different
        }
    assert robot.files == {"parameters.toml": Path("out/parameters.toml").read_text(encoding="utf-8")}
    # What was found is what was simulated, to within its own intervals.
    place = robot.keys.index("b1_m2")
    deviation = robot.covariance[place, place] ** 0.5
    assert abs(robot["b1_m2"] - scenario["parameters.b1_m2"]) < 4 * deviation
    robot.save("robot")
    with pytest.raises(FileExistsError):
        robot.save("robot")
    scenario.parameters = "robot/parameters.toml"
    assert scenario.simulate().ended_early is None


def test_a_certificate(program: Program) -> None:
    said = json.loads(program("certify", "--size", "0.05", "--raise", "0", "--out", "out", "--json"))
    proved = ballbot.certify(ballbot.Scenario.builtin("two-setpoints"), size=0.05, trials=0)
    assert said["k"] == proved.k.tolist() and said["p"] == proved.p.tolist()
    assert said["level"] == proved.level and said["boxes"] == proved.boxes
    # Each accepts the other's.
    proved.save("certificate.json")
    assert json.loads(program("verify", "certificate.json", "--json"))["level"] == proved.level
    again = ballbot.verify("out/certificate.json")
    assert again.level == proved.level and again.reach.tolist() == proved.reach.tolist()


def test_what_is_guaranteed(program: Program) -> None:
    said = json.loads(program("campaign", "--runs", "20", "--samples", "10", "--seed", "7", "--out", "out", "--json"))
    found = ballbot.count_guarantee(runs=20, samples=10, seed=7)
    assert [one["variant"] for one in said["variants"]] == [one.variant for one in found]
    assert [one["tally"] for one in said["variants"]] == [one.tally for one in found]
    assert all(one.broken_promises == 0 for one in found if one.is_nominal)
