"""Simulated closed loops."""

import gc
import os
import signal
import threading

import casadi as ca
import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

import lpvmpc
from plants import cart_pole, double_integrator

Q, R = [2.0, 5.0, 0.2, 0.2], [0.05]


def controller(**settings):
    return lpvmpc.Mpc(cart_pole(), 0.05, 30, Q, R, **settings)


def test_the_plant_moves_as_scipy_integrates_it():
    plant = cart_pole()
    pushes = [lpvmpc.Load(0.13, 0.31, [0, 0, 0, 2.0]), lpvmpc.Jump(0.42, [0.1, 0, 0, 0.5])]
    law = lambda t, x: [3 * np.sin(5 * t)]  # noqa: E731
    run = lpvmpc.simulate(plant, law, [0, 0.2, 0, 0], 0.6, t_s=0.05, disturbances=pushes)
    x = np.array([0, 0.2, 0, 0])
    events = sorted({*np.round(np.arange(0, 0.6, 0.05), 12), 0.13, 0.31, 0.42, 0.6})
    at_samples = [x]
    u = np.zeros(1)
    for start, end in zip(events[:-1], events[1:]):
        if abs(start / 0.05 - round(start / 0.05)) < 1e-9:
            u = np.array(law(round(start / 0.05) * 0.05, x))
        if start == 0.42:
            x = x + [0.1, 0, 0, 0.5]
        load = np.array([0, 0, 0, 2.0 if 0.13 <= start < 0.31 else 0.0])
        motion = solve_ivp(lambda t, x: plant.f(x, u) + load, (start, end), x, "DOP853",
                           rtol=1e-12, atol=1e-12)  # fmt: skip
        x = motion.y[:, -1]
        if abs(end / 0.05 - round(end / 0.05)) < 1e-9:
            at_samples.append(x)
    np.testing.assert_allclose(run.x, at_samples, atol=1e-7)


def test_the_number_of_other_places_does_not_matter():
    """Tolerances hold per state of the plant, however many places there are."""
    run = lpvmpc.simulate(double_integrator(), lambda t, x: [1.0], [0, 0], 1.0, t_s=0.1)
    np.testing.assert_allclose(run["position"], run.t**2 / 2, atol=1e-12)


def test_a_controller_sees_its_reference_ahead():
    reference = lambda t: [0.6 if t >= 1.0 else 0.0, 0, 0, 0]  # noqa: E731
    run = lpvmpc.simulate(cart_pole(), controller(), [0] * 4, 3.0, x_ref=reference)
    assert run.is_solved and set(run.status) == {"converged"}
    assert abs(run["position"][-1] - 0.6) < 0.02
    before = np.abs(run["force"][run.t[:-1] < 0.95]).max()
    assert before > 0.1  # it moves before the step
    by_sample = np.array([reference(i * 0.05) for i in range(200)])
    again = lpvmpc.simulate(cart_pole(), controller(), [0] * 4, 3.0, x_ref=by_sample)
    assert (again.x == run.x).all()
    turned = pd.DataFrame(by_sample[:, ::-1], columns=["rate", "speed", "tilt", "position"])
    named = lpvmpc.simulate(cart_pole(), controller(), [0] * 4, 3.0, x_ref=turned)
    assert (named.x == run.x).all()


def test_an_input_reference_is_followed_by_time():
    """Every sample was told that of the first ones."""
    rows = np.repeat([0.0, 0.2, -0.1], 12)[:, None]
    mpc = lpvmpc.Mpc(double_integrator(), 0.1, 5, [1, 1], [1])
    run, of_time, constant, single = (
        lpvmpc.simulate(double_integrator(), mpc, [1, 0], 4.0, u_ref=given)
        for given in (rows, lambda t: rows[min(round(t / 0.1), 35)], np.full((1, 1), 0.2), [0.2])
    )
    mpc.reset()
    for i, x in enumerate(run.x[:-1]):
        assert (mpc.step(x, u_ref=rows[min(i, 35):]).u0 == run.u[i]).all()
    assert (of_time.x == run.x).all() and (constant.x == single.x).all()


def test_noise_comes_from_its_seed():
    sensors = {"tilt": lpvmpc.Sensor(noise=0.02), "rate": lpvmpc.Sensor(bias=0.1)}
    runs = [
        lpvmpc.simulate(cart_pole(), controller(), [0] * 4, 5.0, sensors=sensors, seed=seed)
        for seed in (1, 1, 2)
    ]
    assert (runs[0].x == runs[1].x).all() and (runs[0].x != runs[2].x).any()
    error = runs[0].x_measured - runs[0].x[:-1]
    assert error[:, 1].std() == pytest.approx(0.02, rel=0.25)
    np.testing.assert_allclose(error[:, 3], 0.1)
    assert (error[:, 0] == 0).all()


def test_dropouts_leave_the_last_reading():
    run = lpvmpc.simulate(
        double_integrator(), lambda t, x: [1.0], [0, 0], 5, t_s=0.1,
        sensors={"position": lpvmpc.Sensor(dropout=0.5)},
    )  # fmt: skip
    stale = run.x_measured[:, 0] != run.x[:-1, 0]
    assert 10 < stale.sum() < 40
    for i in np.flatnonzero(stale):
        assert run.x_measured[i, 0] == run.x_measured[i - 1, 0]


def test_delay_and_actuators():
    law = lambda t, x: [2.0]  # noqa: E731
    plant = double_integrator()
    late = lpvmpc.simulate(plant, law, [0, 0], 1.0, t_s=0.1, delay=0.25)
    assert late["speed"][-1] == pytest.approx(2.0 * 0.75)
    weak = lpvmpc.simulate(
        plant, law, [0, 0], 1.0, t_s=0.1, actuators={"force": lpvmpc.Actuator(limit=1.5, dead_zone=0.5)}
    )
    assert weak["speed"][-1] == pytest.approx(1.0)


def test_another_robot_than_the_model():
    heavier = cart_pole().with_parameters(pole_mass=0.5)
    run = lpvmpc.simulate(heavier, controller(), [0, 0.3, 0, 0], 4.0)
    assert np.abs(run.x[-1]).max() < 0.02


def test_the_record():
    run = lpvmpc.simulate(cart_pole(), controller(), [0, 0.3, 0, 0], 1.02, x_ref=[0.1, 0, 0, 0])
    assert run.u.shape == (21, 1) and run.x.shape == (22, 4) and run.y.shape == (21, 2)
    np.testing.assert_allclose(run["tip_height"], np.cos(run["tilt"][:-1]))
    frame = run.to_dataframe()
    assert list(frame.columns)[:5] == ["position", "tilt", "speed", "rate", "force"]
    assert frame["position_ref"].iloc[0] == 0.1 and np.isnan(frame["force"].iloc[-1])
    cost = sum(
        (x - [0.1, 0, 0, 0]) @ np.diag(Q) @ (x - [0.1, 0, 0, 0]) + 0.05 * u[0] ** 2
        for x, u in zip(run.x[:-1], run.u)
    )
    assert run.cost(Q, R) == pytest.approx(cost)
    for place, given in (("q", ([np.nan] * 4, R)), ("r", (Q, [np.inf])), ("u_ref", (Q, R, [np.nan]))):
        with pytest.raises(lpvmpc.SettingError, match=f"{place}: it has an entry that is not finite"):
            run.cost(*given)
    with pytest.raises(KeyError, match="height"):
        run["height"]


def test_a_signal_that_is_called_as_a_reference_keeps_its_column():
    """The reference took its place."""
    plant = lpvmpc.Plant.from_matrices(
        [[0, 1], [0, 0]], [[0], [1]], [[2, 0]], states=["position", "speed"], outputs=["position_ref"]
    )
    frame = lpvmpc.simulate(plant, lambda t, x: [0.0], [1, 0], 0.3, [5, 0], t_s=0.1).to_dataframe()
    assert frame["position_ref"].iloc[0] == 2 and frame["position_ref_"].iloc[0] == 5
    assert len(set(frame.columns)) == len(frame.columns) == 6


def test_a_figure_shows_what_has_a_value():
    """Of an output without a value somewhere, matplotlib refused the limits."""
    import matplotlib

    matplotlib.use("Agg")
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    plant = lpvmpc.Plant.from_casadi(x, u, u, y=ca.vertcat(ca.sqrt(x), ca.log(-1 - x**2)), states=["x"], inputs=["u"])
    run = lpvmpc.simulate(plant, lambda t, x: [-1.0], [0.5], 1.0, t_s=0.1)
    assert np.isnan(run["y_0"]).any() and np.isnan(run["y_1"]).all()
    panels = run.plot().axes
    assert panels[2].get_ylim()[1] == pytest.approx(np.sqrt(0.5) * 1.08, rel=0.05) and len(panels) == 4
    matplotlib.pyplot.close("all")


def test_figure():
    import matplotlib

    matplotlib.use("Agg")
    run = lpvmpc.simulate(cart_pole(), controller(), [0, 0.5, 0, 0], 2.0, x_ref=[0.3, 0, 0, 0])
    figure = run.plot()
    panels = figure.axes
    assert [panel.get_ylabel() for panel in panels][:2] == ["position\n[m]", "tilt\n[rad]"]
    assert panels[-1].get_xlabel() == "time [s]" and len(panels) == 7
    force = panels[4]
    assert force.get_ylim()[1] > 15  # its bound is in the figure
    assert len(run.plot(["tilt"]).axes) == 1
    with pytest.raises(lpvmpc.SettingError, match="there is no 'height'"):
        run.plot(["height"])
    matplotlib.pyplot.close("all")


def test_progress(capsys):
    lpvmpc.simulate(double_integrator(), lambda t, x: [0.0], [0, 0], 1, t_s=0.1, progress=True)
    assert "10/10" in capsys.readouterr().err


@pytest.mark.alone
def test_ctrl_c_ends_it():
    plant, mpc = cart_pole(), controller()
    # Python ignores what a finaliser raises, an interrupt, too: nothing is left that could be finalised.
    gc.collect()
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        lpvmpc.simulate(plant, mpc, [0, 0.1, 0, 0], 1e5)


def diverging(t, x):
    return [1e300]


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda s: s([0, 0, 0], 1.0), lpvmpc.SettingError, "x0: its shape"),
        (lambda s: s([0, 0, 0, np.nan], 1.0), lpvmpc.SettingError, "x: rate is NaN"),
        (lambda s: s([0] * 4, 0.0), lpvmpc.SettingError, "duration"),
        (lambda s: s([0] * 4, np.inf), lpvmpc.SettingError, "duration"),
        (lambda s: s([0] * 4, 1e-12), lpvmpc.SettingError, "duration: it is 1e-12 s; it must be at least one sample"),
        (lambda s: s([0] * 4, 1.0, [0, 1]), lpvmpc.SettingError, "x_ref"),
        (lambda s: s([0] * 4, 1.0, lambda t: [t]), lpvmpc.SettingError, "x_ref at 0 s"),
        (lambda s: s([0] * 4, 1.0, u_ref=np.zeros((9, 2))), lpvmpc.SettingError, r"u_ref: .* \(1,\), \(samples, 1\) or"),
        (lambda s: s([0] * 4, 1.0, t_s=0.1), lpvmpc.SettingError, "t_s"),
        (lambda s: s([0] * 4, 1.0, delay=-1.0), lpvmpc.SettingError, "delay"),
        (lambda s: s([0] * 4, 1.0, seed=-1), lpvmpc.SettingError, "seed"),
        (lambda s: s([0] * 4, 1.0, sensors={"height": lpvmpc.Sensor()}), lpvmpc.SettingError, "height"),
        (lambda s: s([0] * 4, 1.0, sensors={"tilt": 0.1}), lpvmpc.SettingError, "no lpvmpc.Sensor"),
        (lambda s: s([0] * 4, 1.0, sensors={"tilt": lpvmpc.Sensor(noise=-1)}), lpvmpc.SettingError, "noise"),
        (lambda s: s([0] * 4, 1.0, sensors="good"), lpvmpc.SettingError, "sensors: 'good' is not lpvmpc.Sensor by name"),
        (lambda s: s([0] * 4, 1.0, actuators=[1]), lpvmpc.SettingError, "actuators: .* is not lpvmpc.Actuator by name"),
        (lambda s: s([0] * 4, 1e308), lpvmpc.SettingError, "duration: .* there is room for 10000000"),
        (lambda s: s([0] * 4, 1e12), lpvmpc.SettingError, "duration: .* there is room for 10000000"),
        (lambda s: s([0] * 4, 1.0, disturbances=["wind"]), lpvmpc.SettingError, r"disturbances\[0\]"),
        (lambda s: s([0] * 4, 1.0, disturbances=[lpvmpc.Load(1, 0, [0] * 4)]), lpvmpc.SettingError, "disturbance 0"),
        (lambda s: s([0] * 4, 1.0, relative_tolerance=0.0), lpvmpc.SettingError, "tolerances"),
        (lambda s: s([0] * 4, 1.0, relative_tolerance="fine"), lpvmpc.SettingError, "relative_tolerance: it is 'fine'"),
        (lambda s: s([0] * 4, "long"), lpvmpc.SettingError, "duration: it is 'long'"),
        (lambda s: s([0] * 4, 1.0, sensors={"tilt": lpvmpc.Sensor("much")}), lpvmpc.SettingError, "sensors, tilt, noise"),
        (lambda s: s([0] * 4, 1.0, disturbances=lpvmpc.Jump(1, [0] * 4)), lpvmpc.SettingError, "is not a list of"),
        (lambda s: s([0] * 4, 1.0, disturbances=[lpvmpc.Jump(-1, [0] * 4)]), lpvmpc.SettingError, r"\[0\], time: it is -1"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(call, error, message):
    def simulate(*arguments, **others):
        return lpvmpc.simulate(cart_pole(), controller(), *arguments, **others)

    with pytest.raises(error, match=message):
        call(simulate)


def test_a_controller_of_a_plant_with_its_names_in_another_order_is_refused():
    """Its states were taken for each other."""
    f, g = [[0, 1], [0, 0]], [[0], [1]]
    mpc = lpvmpc.Mpc(lpvmpc.Plant.from_matrices(f, g, states=["position", "speed"]), 0.1, 10, [1, 0.1], [0.1])
    turned = lpvmpc.Plant.from_matrices([[0, 0], [1, 0]], [[1], [0]], states=["speed", "position"])
    with pytest.raises(lpvmpc.SettingError, match="controller: its states are position, speed, and those of the plant speed"):
        lpvmpc.simulate(turned, mpc, [0, 1], 0.5)
    # A plant may call them as it likes.
    assert lpvmpc.simulate(lpvmpc.Plant.from_matrices(f, g), mpc, [1, 0], 0.5).is_solved


def test_runs_and_plans_are_equal_to_themselves():
    run, other = (lpvmpc.simulate(cart_pole(), controller(), [0] * 4, 0.2) for _ in range(2))
    assert run == run and run != other and run.plans[0] != other.plans[0]
    assert len({run, other, run.plans[0]}) == 3
    with pytest.raises(lpvmpc.SettingError, match="signals: there are none"):
        run.plot([])


def test_the_cost_of_a_run_without_reference_is_about_the_equilibrium():
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    tank = lpvmpc.Plant.from_casadi(
        x, u, u - 0.5 * ca.sqrt(x), states=["level"], inputs=["inflow"], bounds={"inflow": (0, 2)},
        equilibrium=([1.0], [0.5]),
    )  # fmt: skip
    run = lpvmpc.simulate(tank, lpvmpc.Mpc(tank, 0.5, 20, [1], [0.1]), [1.0], 5.0)
    assert run.cost([1], [0.1], u_ref=[0.5]) < 1e-12
    assert abs(run.cost([1], [0.1]) - 10 * 0.1 * 0.25) < 1e-12


def test_controllers_that_make_no_sense():
    plant = double_integrator()
    with pytest.raises(lpvmpc.SettingError, match="plant: int is no lpvmpc.Plant"):
        lpvmpc.simulate(3, lambda t, x: [0.0], [0, 0], 1.0, t_s=0.1)
    for design in (lpvmpc.lqr, lpvmpc.certify):
        with pytest.raises(lpvmpc.SettingError, match="plant: int is no lpvmpc.Plant"):
            design(1, 0.1, [1], [1])
    with pytest.raises(lpvmpc.SettingError, match="for 4 states"):
        lpvmpc.simulate(plant, controller(), [0, 0], 1)
    with pytest.raises(lpvmpc.SettingError, match="needs a sampling time"):
        lpvmpc.simulate(plant, lambda t, x: [0], [0, 0], 1)
    with pytest.raises(lpvmpc.SettingError, match="neither an Mpc nor a function"):
        lpvmpc.simulate(plant, 3, [0, 0], 1, t_s=0.1)
    with pytest.raises(lpvmpc.SettingError, match="controller: its shape"):
        lpvmpc.simulate(plant, lambda t, x: [0, 1], [0, 0], 1, t_s=0.1)
    with pytest.raises(lpvmpc.SimulationError, match="0.5 s is not finite"):
        lpvmpc.simulate(plant, lambda t, x: [np.nan if t > 0.45 else 0.0], [0, 0], 1, t_s=0.1)
    explosive = lpvmpc.Plant.from_sympy(*_explosive())
    with pytest.raises(lpvmpc.SimulationError, match="after 0.9"):
        lpvmpc.simulate(explosive, lambda t, x: [0.0], [1.0], 2, t_s=0.1)


def _explosive():
    """x_dot = x^2: from 1 it is infinite after a second."""
    import sympy as sp

    x, u = sp.symbols("x u")
    return [x], [u], [x**2 + u]
