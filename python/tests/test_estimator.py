"""State and disturbances from readings, and plants in discrete time."""

import pickle

import numpy as np
import pandas as pd
import pytest
from plants import cart_pole, cart_pole_formulas, double_integrator
from scipy.linalg import expm, solve_discrete_are

import lpvmpc

MEASURED = {"tip_position": 1e-6, "tilt": 1e-6}


def estimator(**others):
    return lpvmpc.Estimator(
        measured=MEASURED,
        state_noise={"position": 1e-6, "tilt": 1e-6, "speed": 1e-3, "rate": 1e-3},
        initial_state=0.1,
        **others,
    )


def controller(**others):
    return lpvmpc.Mpc(cart_pole(), 0.04, 40, [20, 10, 0.1, 0.1], [0.01], **others)


def test_a_loop_behind_filter_and_delay_tracks_without_offset():
    real = cart_pole().with_parameters(pole_mass=0.36)
    push = lpvmpc.Load(0.0, np.inf, [0, 0, 0.8, -1.2])
    sensors = {"tilt": lpvmpc.Sensor(noise=1e-3), "tip_position": lpvmpc.Sensor(noise=1e-3, dropout=0.2)}

    def run(disturbances):
        mpc = controller(estimator=estimator(delay=0.08, disturbances=disturbances))
        return lpvmpc.simulate(
            real, mpc, [0, 0.05, 0, 0], 14.0, [0.4, 0, 0, 0],
            sensors=sensors, disturbances=[push], delay=0.08, seed=3,
        )  # fmt: skip

    found = run({"force": lpvmpc.Disturbance(0.1)})
    assert found.is_solved
    last = slice(-100, None)
    assert abs(found["position"][last].mean() - 0.4) < 0.02
    assert abs(run({})["position"][last].mean() - 0.4) > 0.05
    # 0.8 m/s^2 and -1.2 rad/s^2 are what a force of about 1 N makes.
    assert found.disturbances["force"][last].mean() == pytest.approx(0.95, abs=0.2)
    assert 0.1 < np.isnan(found.readings[:, 0]).mean() < 0.3
    assert not np.isnan(found.readings[:, 1]).any()
    error = found.x_measured[50:] - found.x[50:-1]
    assert np.abs(error[:, 1]).max() < 0.005


def test_a_filter_is_scipys_regulator_dual():
    # Its gain in the long run: that of the stationary Riccati equation of SciPy, on a linear plant.
    t_s, noise, r = 0.1, np.array([0.0, 0.04]), 0.01
    mpc = lpvmpc.Mpc(
        double_integrator(), t_s, 20, [1, 0.1], [0.1],
        estimator=lpvmpc.Estimator({"position": r}, noise, initial_state=[1, 1]),
    )  # fmt: skip
    rng = np.random.default_rng(1)
    for k in range(300):
        mpc.observe(k * t_s, [rng.normal()])
        mpc.decide([0, 0])
    a, b = expm(np.array([[0, t_s], [0, 0]])), np.array([t_s**2 / 2, t_s])
    before, u = mpc.estimate.x, mpc.decide([0, 0]).u0[0]
    # The filter takes the noise of a sample as white over it.
    q = np.array([[t_s**3 / 3, t_s**2 / 2], [t_s**2 / 2, t_s]]) * 0.04
    p = solve_discrete_are(a.T, np.array([[1.0], [0.0]]), q, np.array([[r]]))
    predicted = a @ before + b * u
    mpc.set_last_input([u])
    mpc.observe(300 * t_s, [predicted[0] + 1.0])
    gain = p[:, 0] / (p[0, 0] + r)
    np.testing.assert_allclose(mpc.estimate.x - predicted, gain, rtol=0.02)


def test_the_input_that_was_applied_keeps_its_known_disturbance():
    """That of the sample was forgotten where `set_last_input` said what was applied, even if it was what was planned."""
    t_s, push = 0.1, [0.0, 2.0]
    mpc = lpvmpc.Mpc(
        double_integrator(), t_s, 20, [1, 0.1], [0.1], u_bounds=([-1], [1]),
        estimator=lpvmpc.Estimator({"position": 1e-2}, [0, 1e-4], delay=t_s),
    )  # fmt: skip
    mpc.observe(0.0, [0.0])
    plan = mpc.decide([0, 0], disturbance=push)
    mpc.set_last_input([0.5])
    mpc.set(r=[0.2])
    mpc.set_last_input(plan.u0)
    # Without a reading, what the model makes of it: the input and the push act from 0.1 s on.
    mpc.observe(0.3, [None])
    force = plan.u0[0] + push[1]
    np.testing.assert_allclose(mpc.estimate.x, [force * 0.2**2 / 2, force * 0.2], rtol=1e-9)


def test_readings_by_name_and_what_became_of_them():
    mpc = controller(estimator=estimator(gate=lpvmpc.Gate(deviations=4.0, patience=3)))
    assert not mpc.decide([0, 0, 0, 0]).is_solved  # nothing was measured yet
    said = mpc.observe(0.0, {"tilt": 0.1, "tip_position": None})
    assert said["tip_position"] == "missing" and said["tilt"].startswith("used")
    for k in range(1, 30):
        mpc.observe(0.04 * k, {"tilt": 0.1, "tip_position": 0.1})
        mpc.set_last_input([0.0])
    said = mpc.observe(1.2, {"tilt": 0.1, "tip_position": 50.0})
    assert said == {"tip_position": "outlier", "tilt": "used"}
    assert mpc.observe(1.24, [np.nan, np.inf]) == {"tip_position": "missing", "tilt": "not finite"}
    assert mpc.estimate.disturbances == {}
    mpc.reset()
    np.testing.assert_array_equal(mpc.estimate.x, 0)


def test_masked_readings_are_missing():
    """What stands behind the mask was taken for a reading."""
    masked = np.ma.array([9.0, 0.1], mask=[True, False])
    for readings in (masked, {"tip_position": np.ma.masked, "tilt": 0.1}, [np.ma.masked, 0.1]):
        mpc = controller(estimator=estimator())
        assert mpc.observe(0.0, readings) == {"tip_position": "missing", "tilt": "used"}
    one, other = (controller(estimator=estimator()) for _ in range(2))
    one.observe(0.0, masked)
    other.observe(0.0, [None, 0.1])
    assert (one.estimate.x == other.estimate.x).all()


def test_readings_and_variances_of_pandas_are_taken_by_their_names():
    """They were taken by their order."""
    noise = {"rate": 1e-2, "speed": 1e-3, "tilt": 1e-6, "position": 1e-5}
    one, other = (
        controller(estimator=lpvmpc.Estimator(measured=MEASURED, state_noise=given)) for given in (noise, pd.Series(noise))
    )
    for k, readings in enumerate(({"tilt": 0.1, "tip_position": 0.3}, {"tilt": 0.2})):
        assert one.observe(0.1 * k, readings) == other.observe(0.1 * k, pd.Series(readings))
        assert (one.estimate.x == other.estimate.x).all()
    with pytest.raises(lpvmpc.SettingError, match="readings: 'speed' is not measured"):
        other.observe(1.0, pd.Series({"speed": 0.1}))
    with pytest.raises(lpvmpc.SettingError, match="readings: its names are tilt, tilt; they must be tip_position, tilt"):
        other.observe(1.0, pd.Series([0.1, 0.2], ["tilt", "tilt"]))


def test_an_estimator_comes_and_goes_and_is_pickled():
    mpc = controller()
    with pytest.raises(lpvmpc.SettingError, match="estimator: the controller has none"):
        mpc.decide([0, 0, 0, 0])
    with pytest.raises(lpvmpc.SettingError, match="estimator: the controller has none"):
        mpc.observe(0.0, [0.0])
    assert mpc.estimate is None
    mpc.set(estimator=estimator(start=[1, 0, 0, 0]))
    assert mpc.estimate.x.tolist() == [1, 0, 0, 0]
    again = pickle.loads(pickle.dumps(mpc))
    assert again.estimate.x.tolist() == [1, 0, 0, 0]
    with pytest.raises(lpvmpc.SettingError, match="q"):
        mpc.set(estimator=None, q=[1, 2])
    assert mpc.estimate is not None
    mpc.observe(0.0, [0.3, 0.1])
    before = mpc.estimate.x.tolist()
    # What only the compiled half refuses.
    with pytest.raises(lpvmpc.SettingError, match="R is not positive definite"):
        mpc.set(estimator=None, r=[-1])
    assert mpc.estimate.x.tolist() == before
    mpc.set(du_bounds=([-4], [4]), substeps=2)
    assert mpc.estimate.x.tolist() == before
    mpc.set(estimator=None)
    assert mpc.estimate is None and mpc.estimator is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"measured": {"tip": 1.0}}, 'estimator, measured: "tip" is no state or output'),
        ({"measured": MEASURED | {"tilt": -1.0}}, "variance"),
        ({"measured": {"tilt": 1.0}}, "estimator, measured: steady states of the plant cannot be told"),
        ({"measured": {"tilt": "a"}}, "estimator, measured, tilt: it is 'a'"),
        ({"state_noise": [1, 2]}, r"estimator, state_noise: its shape is \(2,\)"),
        ({"state_noise": {"lean": 1}}, "estimator, state_noise: there is no 'lean'"),
        ({"start": [1, 2]}, r"estimator, start: its shape is \(2,\)"),
        ({"start": [np.nan, 0, 0, 0]}, "estimator, start: position is NaN"),
        ({"delay": -1.0}, "estimator, delay: it is -1 s"),
        ({"disturbances": {"wind": lpvmpc.Disturbance(1.0)}}, '"wind" is no input or state'),
        ({"disturbances": {"force": 1.0}}, "is no lpvmpc.Disturbance"),
        ({"disturbances": 1.0}, "disturbances: 1.0 is not lpvmpc.Disturbance by name"),
        ({"gate": 3.0}, "is no lpvmpc.Gate"),
        ({"state_noise": [[1], [1, 2]]}, "estimator, state_noise: .* is no array of real numbers"),
        ({"gate": lpvmpc.Gate(patience=-1)}, "gate, patience"),
    ],
)
def test_what_makes_no_sense_is_refused(change, said):
    sound = {"measured": MEASURED, "state_noise": 1e-3}
    with pytest.raises(lpvmpc.SettingError, match=said):
        controller(estimator=lpvmpc.Estimator(**(sound | change)))


def test_a_sensor_of_what_is_not_measured_is_refused():
    mpc = controller(estimator=estimator())
    with pytest.raises(lpvmpc.SettingError, match="sensors: there is no 'speed'; there are tip_position, tilt"):
        lpvmpc.simulate(cart_pole(), mpc, [0] * 4, 1.0, sensors={"speed": lpvmpc.Sensor()})
    with pytest.raises(lpvmpc.SettingError, match="speed_of_sound"):
        mpc.decide([0] * 4, speed_of_sound=1.0)


# Plants in discrete time.


def sampled_cart_pole():
    """The cart-pole after one step of Euler's method."""
    x, u, p, f, values = cart_pole_formulas()
    return lpvmpc.Plant.from_casadi(
        x, u, x + 0.02 * f, p=p, parameters=values, period=0.02, equilibrium=([0] * 4, [0]),
        states=["position", "tilt", "speed", "rate"], inputs=["force"], bounds={"force": (-15, 15)},
    )  # fmt: skip


def test_a_plant_in_discrete_time_moves_by_its_formula():
    plant = sampled_cart_pole()
    assert plant.period == 0.02 and cart_pole().period is None
    x, u = np.array([0.1, 0.4, -0.2, 0.3]), [2.0]
    np.testing.assert_allclose(plant.f(x, u), x + 0.02 * cart_pole().f(x, u), rtol=1e-12)
    mpc = lpvmpc.Mpc(plant, 0.02, 60, [20, 10, 0.1, 0.1], [0.01])
    run = lpvmpc.simulate(plant, mpc, [0, 0.3, 0, 0], 4.0, [0.5, 0, 0, 0])
    assert run.is_solved and np.abs(run.x[-1] - [0.5, 0, 0, 0]).max() < 0.02
    for k in (0, 7, 100):
        np.testing.assert_allclose(run.x[k + 1], plant.f(run.x[k], run.u[k]), rtol=1e-12, atol=1e-15)
    # Two of its steps in a sample of a law.
    twice = lpvmpc.simulate(plant, lambda t, x: [1.0], [0, 0.1, 0, 0], 0.04, t_s=0.04)
    by_hand = plant.f(plant.f([0, 0.1, 0, 0], [1]), [1])
    np.testing.assert_allclose(twice.x[-1], by_hand, rtol=1e-12, atol=1e-15)


def test_matrices_of_a_sampled_plant_and_their_regulator():
    a, b = np.array([[1.0, 0.1], [-0.3, 0.95]]), np.array([[0.005], [0.1]])
    plant = lpvmpc.Plant.from_matrices(a, b, period=0.1)
    found = lpvmpc.lqr(plant, 0.1, [1, 2], [0.5])
    p = solve_discrete_are(a, b, np.diag([1.0, 2.0]), np.array([[0.5]]))
    np.testing.assert_allclose(found.p, p, rtol=1e-9)
    with pytest.raises(lpvmpc.SettingError, match="t_s: it is 0.2 s; the plant is in discrete time"):
        lpvmpc.lqr(plant, 0.2, [1, 2], [0.5])
    with pytest.raises(lpvmpc.SettingError, match="t_s: it is 0.2 s"):
        lpvmpc.Mpc(plant, 0.2, 10, [1, 1], [1])
    with pytest.raises(lpvmpc.SettingError, match="whole number of the plant's periods of 0.1 s"):
        lpvmpc.simulate(plant, lambda t, x: [0.0], [0, 0], 1.0, t_s=0.15)
    for period in (0.0, -1.0, np.nan):
        with pytest.raises(lpvmpc.PlantError, match="period|not finite"):
            lpvmpc.Plant.from_matrices(a, b, period=period)
    assert pickle.loads(pickle.dumps(plant)) == plant


def test_steps_too_long_for_a_plant_are_refused():
    stiff = lpvmpc.Plant.from_matrices([[-300.0]], [[1.0]])
    with pytest.raises(lpvmpc.SettingError, match="at least 11 substeps are needed"):
        lpvmpc.Mpc(stiff, 0.1, 10, [1], [1])
    lpvmpc.Mpc(stiff, 0.1, 10, [1], [1], substeps=11)


def test_a_first_plan_may_take_more_programs():
    # From far away; eight are too few, and the next samples have a plan to begin with.
    x0, x_ref = [0, 2.5, 0, 0], [0.5, 0, 0, 0]
    costs = [
        controller(first_programs=first, max_programs=8).step(x0, x_ref) for first in (1, 8, 50)
    ]
    # After fifty, which are more than eight, plans from two other beginnings may have as many each.
    assert [plan.programs <= most for plan, most in zip(costs, (1, 8, 3 * 50), strict=True)] == [True] * 3
    assert costs[0].cost >= costs[1].cost >= costs[2].cost
    mpc = controller(first_programs=50, max_programs=2)
    assert mpc.step(x0, x_ref).programs > 2
    assert mpc.step(x0, x_ref).programs <= 2
    mpc.reset()
    assert mpc.step(x0, x_ref).programs > 2
    with pytest.raises(lpvmpc.SettingError, match="first_programs"):
        controller(first_programs=-1)
