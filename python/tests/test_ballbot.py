"""The ballbot: scenarios as objects, what is refused, what long computations owe to whom started them."""

from __future__ import annotations

import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lpvmpc
from lpvmpc import ballbot

SHORT = {"title": "t", "scenario": "two-setpoints", "runs": 4, "set": {"duration_s": 0.2}}


@pytest.fixture
def scenario() -> ballbot.Scenario:
    return ballbot.Scenario.builtin("two-setpoints")


def test_keys_are_read_and_changed(scenario: ballbot.Scenario) -> None:
    assert scenario.controller.horizon == scenario["controller.horizon"] == 20
    scenario.controller.horizon = np.int64(25)
    scenario["bounds"]["torque_nm"] = np.array([-1.0, 0.5])
    scenario.bounds["torque_nm.0"] = -2
    assert scenario["controller.horizon"] == 25 and scenario.bounds.torque_nm == (-2, 0.5)
    # What is taken away has its default, which is there to be read.
    del scenario.bounds.theta_rad
    assert scenario.bounds.theta_rad == (-np.inf, np.inf) and "theta_rad" in scenario.bounds
    points = scenario.reference.set_points.points
    points[0].phi_rad = 1.25
    assert scenario["reference.set_points.points.0.phi_rad"] == 1.25
    assert set(scenario) == set(scenario.to_dict())
    # A table has its defaults, whether one reads it or the whole.
    assert scenario.controller.to_dict() == scenario.to_dict()["controller"]


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("controller.horizn", 3, "did you mean `horizon`"),
        ("titel", "x", "did you mean `title`"),
        ("controller.model", "linaer", "did you mean `linear`"),
        ("controller.horizon", "ten", "whole number"),
        ("controller.horizon.x", 3, "would stand below a value"),
        ("bounds.torque_nm.7", 3.0, "not a place in a list of 2"),
        ("controller.horizon", object(), "it must be a number"),
        ("title", None, "it must be a number"),
        ("", 3, "not the name of a key"),
    ],
)
def test_what_is_no_scenario_is_refused_and_changes_nothing(
    scenario: ballbot.Scenario, key: str, value: Any, said: str
) -> None:
    before = scenario.copy()
    with pytest.raises(lpvmpc.ScenarioError, match=said):
        scenario.update({"duration_s": 1.0, key: value})
    assert scenario == before and scenario.to_toml() == before.to_toml()


def test_values_that_make_no_sense_are_named(scenario: ballbot.Scenario) -> None:
    for key, value in {"controller.t_s": -1.0, "duration_s": float("nan"), "controller.r": 0.0}.items():
        changed = scenario.copy()
        changed[key] = value
        with pytest.raises(lpvmpc.ScenarioError, match=key):
            changed.check()
        with pytest.raises(lpvmpc.ScenarioError, match=key):
            changed.simulate()
    for table in (scenario, scenario.controller):
        with pytest.raises(AttributeError, match="there is no key"):
            table.nothing  # noqa: B018
    with pytest.raises(KeyError):
        scenario["controller.nothing"]
    with pytest.raises(lpvmpc.ScenarioError, match="did you mean `two-setpoints`"):
        ballbot.Scenario.builtin("two-setpoint")
    with pytest.raises(lpvmpc.ScenarioError, match="nothing.toml"):
        ballbot.Scenario.load("nothing.toml")
    with pytest.raises(lpvmpc.ScenarioError, match="missing field"):
        ballbot.Scenario({"title": "t"})


def test_files_and_copies(scenario: ballbot.Scenario, tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    scenario.save(path)
    assert path.read_text(encoding="utf-8").startswith("#"), "comments are kept while nothing is changed"
    scenario.controller.r = 0.1 + 0.2
    with pytest.raises(FileExistsError):
        scenario.save(path)
    scenario.save(path, overwrite=True)
    loaded = ballbot.Scenario.load(path)
    again: ballbot.Scenario = pickle.loads(pickle.dumps(scenario))
    for other in (loaded, again, ballbot.Scenario(scenario.to_toml()), ballbot.Scenario(scenario.to_dict())):
        assert other == scenario and other.controller.r == 0.1 + 0.2
    assert loaded.folder == tmp_path
    other = scenario.copy()
    other.controller.horizon = 5
    assert other != scenario and scenario.controller.horizon == 20
    assert "two-setpoints" in ballbot.builtin_names()


def test_a_run_has_its_numbers(scenario: ballbot.Scenario) -> None:
    run = scenario.simulate()
    samples = len(run.t) - 1
    assert run.state.shape == run.reference.shape == (samples + 1, 4) and run.input.shape == (samples,)
    assert np.allclose(np.diff(run.t), run.t_s)
    # Metrics against the arrays, by their definitions.
    assert run.metrics["largest_tilt_rad"] == np.abs(run["theta"]).max()
    assert run.metrics["largest_torque_nm"] == np.abs(run.input).max()
    error = run["phi"] - run["phi_ref"]
    assert np.isclose(run.metrics["rms_error_rad"], np.sqrt(np.mean(error**2)), rtol=1e-12)
    q, r = np.array(scenario.controller.q), scenario.controller.r
    e = (run.state - run.reference)[:-1]
    assert np.isclose(run.metrics["closed_loop_cost"], (e**2 @ q).sum() + r * (run.input**2).sum(), rtol=1e-12)
    assert run.planes[0].is_solved.all() and "largest tilt" in str(run)
    with pytest.raises(KeyError, match="there are phi"):
        run["ph"]
    frame = run.to_dataframe()
    assert frame["torque"].iloc[:-1].tolist() == run.input.tolist() and np.isnan(frame["torque"].iloc[-1])


def test_a_run_that_ends_early_says_why(scenario: ballbot.Scenario) -> None:
    scenario.bounds.torque_nm = [-0.02, 0.02]
    run = scenario.simulate()
    assert run.ended_early and "ended early" in str(run)
    assert len(run.t) - 1 < run.samples and run.state.shape[0] == len(run.t)
    assert "ended early" in repr(run)


def test_two_planes(tmp_path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    scenario = ballbot.Scenario.builtin("lissajous")
    scenario.duration_s = 4.0
    run = scenario.simulate()
    assert run.state.shape == (81, 2, 4) and run.input.shape == (80, 2)
    assert (run["y.phi"] == run.state[:, 1, 0]).all() and set(run.metrics) == {"x", "y"}
    with pytest.raises(KeyError, match=r"x\.phi"):
        run["phi"]
    assert list(run.to_dataframe()["x.theta"]) == run.state[:, 0, 1].tolist()
    for kind, panels in {"run": 12, "motors": 2, "plans": 2}.items():
        assert len(run.plot(kind).axes) == panels
    figure = run.plot("path")
    figure.savefig(tmp_path / "path.png")
    # Of one or two samples there were too few points to find the scale of a curve.
    scenario.duration_s = scenario.controller.t_s
    assert scenario.simulate().plot().axes
    x, y = figure.axes[0].lines[0].get_data()
    assert np.allclose(x, run.metres_per_rad * run["x.phi"]) and np.allclose(y, run.metres_per_rad * run["y.phi"])
    matplotlib.pyplot.close("all")


def test_a_figure_shows_the_run(scenario: ballbot.Scenario) -> None:
    import matplotlib.figure

    run = scenario.simulate()
    figure = run.plot(figure=matplotlib.figure.Figure())
    shown = {panel.get_ylabel(): panel for panel in figure.axes}
    assert len(shown) == 6
    tilt = shown["θ [rad]"].lines[0]
    assert np.array_equal(np.asarray(tilt.get_ydata()), run["theta"])
    low, high = run.bounds["theta"]
    assert {low, high} <= {float(np.asarray(line.get_ydata())[0]) for line in shown["θ [rad]"].lines[1:]}
    with pytest.raises(lpvmpc.ScenarioError, match="must be one of run, plans"):
        run.plot("path")
    scenario.update({"accept_unusual_values": True, "initial_state.theta_rad": 1.7})
    with pytest.raises(lpvmpc.ScenarioError, match="no sample that a figure could show"):
        scenario.simulate().plot()
    guaranteed = ballbot.Scenario.builtin("far-setpoints")
    guaranteed.duration_s = 1.0
    run = guaranteed.simulate()
    _, aims, backed = run.plot("plans", matplotlib.figure.Figure()).axes
    assert np.array_equal(np.asarray(aims.lines[0].get_ydata()), run["set_point"])
    assert [label.get_text() for label in backed.get_yticklabels()] == ["new plan"]


def test_campaigns_are_checked(tmp_path: Path) -> None:
    for changes, said in (
        ({"runs": 0}, "runs"),
        ({"rns": 3}, "did you mean `runs`"),
        ({"scenario": "two-setpoint"}, "did you mean"),
        ({"vary": [{"key": "controller.horizn", "uniform": [1.0, 2.0]}]}, "horizn"),
        ({"vary": [{"key": "controller.r", "uniform": [2.0, 1.0]}]}, r"vary\[0\]"),
    ):
        with pytest.raises(lpvmpc.ScenarioError, match=said):
            ballbot.campaign(SHORT | changes)
    with pytest.raises(FileNotFoundError):
        ballbot.campaign(tmp_path / "none.toml")
    with pytest.raises(lpvmpc.SettingError, match="threads"):
        ballbot.campaign(SHORT, threads=-1)
    (tmp_path / "mine.toml").write_text(ballbot.Scenario.builtin("two-setpoints").to_toml(), encoding="utf-8")
    found = ballbot.campaign(SHORT | {"scenario": "mine.toml"}, folder=tmp_path)
    assert len(found) == 4 and found.to_dataframe()["success"].all()
    assert ballbot.campaign_example().startswith("#")


def test_files_that_are_no_texts_are_named(tmp_path: Path) -> None:
    binary = tmp_path / "binary"
    binary.write_bytes(b"\xff\xfe")
    endless = Path("/dev/zero")
    for path, said in ((binary, "binary: it is not text in UTF-8"), (endless, "/dev/zero: it has more than 64 MiB")):
        if not path.exists():
            continue
        for read in (lpvmpc.Certificate.load, ballbot.campaign):
            with pytest.raises(OSError, match=said):
                read(path)
        with pytest.raises(lpvmpc.SettingError, match=f"config: .*{said}"):
            ballbot.excite(path)


def test_columns_may_have_gaps_and_are_named_where_they_are_none(tmp_path: Path) -> None:
    """What is masked was taken for a reading."""
    from lpvmpc.ballbot.identification import _csv

    phi = np.ma.masked_equal([0.5, 99.0, 1.5], 99.0)
    gaps: Any = {"t_s": [0.0, 0.1, 0.2], "phi_rad": phi, "theta_rad": np.array([None, 1.0, 2.0], dtype=object)}
    assert _csv(0, gaps).splitlines()[1:] == ["0.0,0.5,", "0.1,,1.0", "0.2,1.5,2.0"]
    for wrong in (["a", "b", "c"], [1j, 2.0, 3.0]):
        with pytest.raises(lpvmpc.SettingError, match=r"recordings\[0\], phi_rad: .* is no array of real numbers"):
            ballbot.identify([gaps | {"phi_rad": np.array(wrong, dtype=object)}])


def test_what_cannot_be_identified_is_told(tmp_path: Path) -> None:
    t = np.arange(0, 3, 0.01)
    columns = {"t_s": t, "phi_rad": 0 * t, "theta_rad": 0 * t, "theta_dot_rad_s": 0 * t}
    with pytest.raises(lpvmpc.IdentificationError, match="torque_commanded_nm"):
        ballbot.identify([columns])
    with pytest.raises(lpvmpc.SettingError, match="equally long"):
        ballbot.identify([columns | {"torque_commanded_nm": t[1:]}])
    with pytest.raises(lpvmpc.IdentificationError, match="none.csv"):
        ballbot.identify([tmp_path / "none.csv"])
    with pytest.raises(lpvmpc.SettingError, match="a list of recordings"):
        ballbot.identify("log.csv")
    with pytest.raises(lpvmpc.SettingError, match=r"leave_out\[0\]"):
        ballbot.identify(["log.csv"], leave_out=[(2, 0.0, 1.0)])
    wrong: Any
    for wrong in ("all", (1.0,), ("a", 1.0)):
        with pytest.raises(lpvmpc.SettingError, match=r"leave_out\[0\]: "):
            ballbot.identify(["log.csv"], leave_out=[wrong])
    wrong = 3
    with pytest.raises(lpvmpc.SettingError, match="leave_out: 3 is not a list"):
        ballbot.identify(["log.csv"], leave_out=wrong)
    with pytest.raises(lpvmpc.SettingError, match="recordings: it is empty"):
        ballbot.identify([])
    with pytest.raises(lpvmpc.SettingError, match="did you mean `geometry`"):
        ballbot.identify(["log.csv"], {"geometri": {}})
    with pytest.raises(lpvmpc.IdentificationError, match="harmonics"):
        ballbot.excite(harmonics=0)
    for asked in ({"band": 3}, {"band": ("a", 2)}, {"harmonics": 2.5}, {"amplitude": "much"}, {"gain": [1]}):
        with pytest.raises(lpvmpc.SettingError, match=next(iter(asked))):
            ballbot.excite(**asked)
    with pytest.raises(lpvmpc.IdentificationError, match="torque"):
        ballbot.excite(amplitude=float("nan"))
    (tmp_path / "my.toml").write_text(ballbot.identification_example(), encoding="utf-8")
    assert ballbot.excite(tmp_path / "my.toml").torque.any()


def test_a_certificate_that_claims_too_much_is_refused(
    scenario: ballbot.Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    proved = ballbot.certify(scenario, size=0.05, trials=0)
    assert proved.contains(np.zeros(4)) and not proved.contains([10.0, 0, 0, 0])
    # The set reaches just as far as is said of it.
    largest = np.sqrt(proved.level * np.diag(np.linalg.inv(proved.p)))
    assert np.allclose(largest, proved.largest_states, rtol=1e-9)
    assert ballbot.verify(proved) == proved
    text = proved.to_json()
    (tmp_path / "more.json").write_text(text.replace('"level"', '"levle"', 1), encoding="utf-8")
    with pytest.raises(lpvmpc.CertificateError):
        ballbot.verify(tmp_path / "more.json")
    with pytest.raises(FileNotFoundError, match="none.json"):
        ballbot.verify(tmp_path / "none.json")
    wrong: Any = "large"
    with pytest.raises(lpvmpc.SettingError, match="size: it is 'large'"):
        ballbot.certify(scenario, size=wrong)
    with pytest.raises(lpvmpc.SettingError, match="scenario: str is no lpvmpc.ballbot.Scenario"):
        ballbot.certify(wrong)
    at = text.index(str(proved.level))
    claimed = text[:at] + str(100 * proved.level) + text[at + len(str(proved.level)) :]
    (tmp_path / "false.json").write_text(claimed, encoding="utf-8")
    with pytest.raises(lpvmpc.FalseClaimError):
        ballbot.verify(tmp_path / "false.json")
    with pytest.raises(FileNotFoundError):
        ballbot.verify(tmp_path / "none.json")
    with pytest.raises(lpvmpc.CertificateError, match="the size is 2"):
        ballbot.certify(scenario, size=2.0)


@pytest.mark.alone
def test_times_of_a_step() -> None:
    found = ballbot.bench(["two-setpoints"])
    (one,) = found.sequences
    assert one["name"] == "two-setpoints"
    assert 0 < one["qp_us"]["median"] < one["step_us"]["median"] < 1e4
    assert one["step_us"]["median"] < one["step_cold_us"]["median"]
    assert found.to_dataframe().loc["two-setpoints", "step_us.p99"] == one["step_us"]["p99"]
    assert found.guaranteed["guaranteed_us"]["median"] > 0


def test_the_papers_numbers() -> None:
    claims = ballbot.reproduce()
    assert len(claims) > 20 and sum(one["agrees"] is True for one in claims) > len(claims) / 2


@pytest.mark.alone
def test_the_lock_is_let_go_and_progress_told(
    capfd: pytest.CaptureFixture[str], scenario: ballbot.Scenario
) -> None:
    scenario.duration_s = 500.0
    counted, done = 0, threading.Event()

    def count() -> None:
        nonlocal counted
        while not done.is_set():
            counted += 1
            time.sleep(1e-3)

    thread = threading.Thread(target=count)
    thread.start()
    start = time.perf_counter()
    scenario.simulate(progress=True)
    took = time.perf_counter() - start
    done.set()
    thread.join()
    assert counted > 100 * took, f"{counted} in {took} s"
    assert "simulating" in capfd.readouterr().err


@pytest.mark.alone
@pytest.mark.parametrize(
    "long",
    [
        "ballbot.campaign({'title': 't', 'scenario': 'two-setpoints', 'runs': 10_000_000})",
        "ballbot.count_guarantee(runs=1_000_000)",
        "ballbot.certify(ballbot.Scenario.builtin('far-setpoints'))",
        "lpvmpc.certify(masses, t_s=0.1, q=[1] * 5 + [0.1] * 5, r=[0.1] * 2)",
    ],
)
def test_an_interrupt_ends_the_work(tmp_path: Path, long: str) -> None:
    code = f"""
import casadi as ca
import lpvmpc
from lpvmpc import ballbot
# Five in a row on springs that harden: the search for a law takes seconds, that for a set a minute and more.
x, v, u = (ca.SX.sym(name, size) for name, size in [("x", 5), ("v", 5), ("u", 2)])
between = ca.vertcat(x[1:], 0) + ca.vertcat(0, x[:-1])
forces = ca.vertcat(u[0], ca.SX.zeros(3), u[1]) - 4 * x - 0.2 * x**3 - v + between
masses = lpvmpc.Plant.from_casadi(
    ca.vertcat(x, v), u, ca.vertcat(v, forces),
    states=[f"state_{{i}}" for i in range(10)], inputs=["left", "right"],
    bounds={{f"state_{{i}}": (-1, 1) for i in range(5)}},
)
print('on', flush=True)
{long}
"""
    # In a folder without `lpvmpc`: the installed package is meant, not the sources beside the tests.
    command = [sys.executable, "-c", code]
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "on\n"
    time.sleep(0.5)
    start = time.perf_counter()
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=20)
    assert "KeyboardInterrupt" in told and "panicked" not in told
    assert time.perf_counter() - start < 5
