"""Certificates, against SciPy's integration of the plants."""

import json
import pickle
import re

import casadi as ca
import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

import lpvmpc
from plants import cart_pole, double_integrator

T_S = 0.05


def tanks():
    """Four tanks of Johansson, cm and V; they stand where no number is round."""
    h, v = ca.SX.sym("h", 4), ca.SX.sym("v", 2)
    areas, holes = (28, 32, 28, 32), (0.071, 0.057, 0.071, 0.057)
    out = [hole * ca.sqrt(2 * 981 * h[i]) for i, hole in enumerate(holes)]
    pumps = (0.7 * 3.33 * v[0], 0.6 * 3.35 * v[1], 0.4 * 3.35 * v[1], 0.3 * 3.33 * v[0])
    into = (out[2], out[3], 0, 0)
    rates = [(pumps[i] + into[i] - out[i]) / areas[i] for i in range(4)]
    return lpvmpc.Plant.from_casadi(
        h, v, ca.vertcat(*rates), name="tanks",
        bounds={**{f"h_{i}": (0.2, 20) for i in range(4)}, "v_0": (0, 10), "v_1": (0, 10)},
        equilibrium=([12.26296752, 12.7831584, 1.63394113, 1.4090447], [3, 3]),
    )  # fmt: skip


@pytest.fixture(scope="module")
def certified():
    plant = cart_pole()
    return plant, lpvmpc.certify(plant, T_S, [2, 5, 0.1, 0.1], [0.01], x_bounds={"tilt": (-0.4, 0.4)}, trials=0)


def edge(certificate, generator, count):
    """States on the edge of the set."""
    root = np.linalg.inv(np.linalg.cholesky(certificate.p).T)
    directions = generator.normal(size=(count, len(certificate.x)))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return certificate.x + np.sqrt(certificate.level) * (1 - 1e-12) * directions @ root.T


def check(plant, certificate, count):
    generator = np.random.default_rng(5)
    states = edge(certificate, generator, count)
    assert certificate.contains(states).all()
    lower = [-np.inf if one.lower is None else one.lower for one in plant.inputs]
    upper = [np.inf if one.upper is None else one.upper for one in plant.inputs]
    for x in np.concatenate([states, certificate.x + 0.3 * (states - certificate.x)]):
        u = certificate(0.0, x)
        assert (u >= lower).all() and (u <= upper).all()
        motion = solve_ivp(
            lambda t, x: plant.f(x, u), (0, certificate.t_s), x, "DOP853",
            rtol=1e-12, atol=1e-13, t_eval=np.linspace(0, certificate.t_s, 9),
        ).y.T  # fmt: skip
        assert (abs(motion - certificate.x) <= certificate.state_limits).all()
        e, v = x - certificate.x, u - certificate.u
        before, after = certificate.value(x), certificate.value(motion[-1])
        stage = e @ certificate.q @ e + v @ certificate.r @ v
        assert after <= (1 - certificate.contraction) * before - stage + 1e-10 * before


def test_from_the_edge_of_the_set_the_cost_falls(certified):
    plant, certificate = certified
    check(plant, certificate, 150)
    assert certificate.state_limits[1] > np.radians(12)


def test_an_equilibrium_of_rounded_numbers_is_made_exact():
    plant = tanks()
    certificate = lpvmpc.certify(plant, 5.0, [1, 1, 0.1, 0.1], [0.1, 0.1], trials=0)
    check(plant, certificate, 60)
    assert abs(plant.f(certificate.x, certificate.u)).max() < 1e-14
    assert 0 < certificate.within.max() < 1e-11
    assert lpvmpc.verify(certificate, plant).boxes == certificate.boxes


def test_a_file_is_the_certificate(certified, tmp_path):
    plant, certificate = certified
    certificate.save(tmp_path / "certificate.json")
    loaded = lpvmpc.Certificate.load(tmp_path / "certificate.json")
    assert loaded == certificate == pickle.loads(pickle.dumps(certificate))
    verified = lpvmpc.verify(loaded, plant)
    with pytest.raises(lpvmpc.SettingError, match="certificate: str is no lpvmpc.Certificate"):
        lpvmpc.verify("certificate.json", plant)
    assert (verified.reach <= loaded.state_limits).all()
    assert repr(loaded).startswith("<Certificate of 'cart-pole', 0.05 s: level ")
    assert loaded.k.shape == (1, 4) and loaded.u.shape == (1,) and not loaded.contains([0, 2, 0, 0])
    with pytest.raises(lpvmpc.SettingError, match="x: its shape"):
        loaded.contains([0, 0])
    in_another_order = pd.Series([0.0, 2.0, 0.0, 0.0], plant.states[::-1])
    with pytest.raises(lpvmpc.SettingError, match="x: its names are"):  # they were taken by their order
        loaded.contains(in_another_order)
    with pytest.raises(lpvmpc.CertificateError, match="another plant"):
        lpvmpc.verify(loaded, plant.with_parameters(pole_mass=0.31))


def forged(certificate, change):
    """With the digest that the message asks for, as a forger would."""
    document = json.loads(certificate.to_json())
    change(document["certificate"])
    with pytest.raises(lpvmpc.CertificateError, match="changed after it was written") as refused:
        lpvmpc.Certificate(json.dumps(document))
    document["digest"] = re.search("that of the content is ([0-9a-f]{16})", str(refused.value))[1]
    return json.dumps(document)


def test_false_claims_are_refuted(certified):
    plant, certificate = certified
    with pytest.raises(lpvmpc.CertificateError, match="changed after it was written"):
        lpvmpc.Certificate(certificate.to_json().replace("0.05", "0.06"))
    for change, message in [
        (lambda c: c.update(level=c["level"] * 50), "the set reaches"),
        (lambda c: c.update(contraction=0.9), "decrease of x'Px is false"),
        (lambda c: c.update(k=[[0.0] * 4]), "decrease of x'Px is false"),
        (lambda c: c["equilibrium"].update(x=[0.0, 0.1, 0.0, 0.0]), "it is none"),
    ]:
        with pytest.raises(lpvmpc.FalseClaimError, match=message):
            lpvmpc.verify(lpvmpc.Certificate(forged(certificate, change)), plant)


def masses(count, pushed):
    """As many masses on springs, each tied to its neighbours; those named are pushed."""
    x, v, u = ca.SX.sym("x", count), ca.SX.sym("v", count), ca.SX.sym("u", len(pushed))
    forces = []
    for i in range(count):
        near = [k for k in (i - 1, i + 1) if 0 <= k < count]
        forces.append(sum(x[k] - x[i] + 0.5 * (v[k] - v[i]) for k in near) - 2 * x[i])
    for j, i in enumerate(pushed):
        forces[i] += u[j]
    places, inputs = ([f"{name}_{i}" for i in of] for name, of in [("place", range(count)), ("push", pushed)])
    return lpvmpc.Plant.from_casadi(
        ca.vertcat(x, v), u, ca.vertcat(v, *forces), name="masses", inputs=inputs,
        states=[*places, *(f"speed_{i}" for i in range(count))],
        bounds={**dict.fromkeys(places, (-1, 1)), **dict.fromkeys(inputs, (-2, 2))},
    )  # fmt: skip


@pytest.fixture(scope="module", params=[(6, [0, 5]), (8, [0, 1, 3, 4, 6, 7])], ids=["12 x 2", "16 x 6"])
def chain(request):
    count, pushed = request.param
    plant = masses(count, pushed)
    q, r = [1] * count + [0.1] * count, [0.1] * len(pushed)
    return plant, lpvmpc.certify(plant, 0.1, q, r, trials=0)


def test_a_plant_of_many_states_is_certified(chain):
    plant, certificate = chain
    n = len(plant.states)
    check(plant, certificate, 10)
    verified = lpvmpc.verify(certificate, plant)
    assert verified.boxes == certificate.boxes and len(verified.reach) == n
    assert (verified.reach <= certificate.state_limits).all()
    # The set uses the room that the bounds leave, and its motions are within them between the samples, too.
    assert 0.9 < certificate.state_limits[0] <= 1
    inside = [0.3] * (n // 2) + [0] * (n // 2)
    assert certificate.contains(inside) and not certificate.contains([1.01] + [0] * (n - 1))


def test_false_claims_of_many_states_are_refuted(chain):
    plant, certificate = chain

    def other_sign(content):
        content["k"] = [[-entry for entry in row] for row in content["k"]]

    def weaker(content):
        # A cost that is a little too small to pay for the stage cost of one state.
        content["p"][-1][-1] *= 0.7

    for change, message in [
        (lambda c: c.update(level=c["level"] * 1.2), "the set reaches"),
        (lambda c: c.update(contraction=0.5), "decrease of x'Px is false"),
        (other_sign, "decrease of x'Px is false|the set reaches"),
        (weaker, "decrease of x'Px is false|not positive definite|the set reaches"),
    ]:
        with pytest.raises(lpvmpc.FalseClaimError, match=message):
            lpvmpc.verify(lpvmpc.Certificate(forged(certificate, change)), plant)


def test_a_guaranteed_loop_reaches_its_equilibrium(certified):
    plant, certificate = certified
    mpc = lpvmpc.Mpc(plant, T_S, 20, [2, 5, 0.1, 0.1], [0.01], terminal=certificate)
    x0 = [0.5, 0.3, 0.0, 0.0]
    assert not certificate.contains(x0)
    run = lpvmpc.simulate(plant, mpc, x0=x0, duration=6.0)
    assert all(plan.is_guaranteed and plan.is_solved for plan in run.plans)
    assert abs(run.x[-1]).max() < 5e-3 and abs(run.u).max() <= 15
    with pytest.raises(lpvmpc.SettingError, match="larger than the certificate's"):
        mpc.set(q=[20, 5, 0.1, 0.1])
    with pytest.raises(lpvmpc.SettingError, match="tilt is 0.1.* reads: position$"):
        mpc.step(x0, x_ref=[0, 0.1, 0, 0])
    with pytest.raises(lpvmpc.SettingError, match="u_ref: .* nothing else that is ahead"):
        mpc.step(x0, u_ref=[0.1])
    with pytest.raises(lpvmpc.SettingError, match="x_ref, stage 1: tilt is 0.1"):
        mpc.step(x0, x_ref=[[0, 0, 0, 0], [0, 0.1, 0, 0]])
    assert pickle.loads(pickle.dumps(mpc)).step(x0).decision == "new plan"
    other = lpvmpc.Plant.from_matrices(np.zeros((4, 4)), np.ones((4, 1)))
    with pytest.raises(lpvmpc.CertificateError, match="another plant"):
        lpvmpc.Mpc(other, T_S, 20, [2, 5, 0.1, 0.1], [0.01], terminal=certificate)


def exact(plant, x, u):
    """The motion over a sample, at six points."""
    motion = solve_ivp(
        lambda t, x: plant.f(x, u), (0, T_S), x, "DOP853", rtol=1e-11, atol=1e-12, t_eval=np.linspace(0, T_S, 6)
    )
    return motion.y.T


BOUNDS = {"force": (-10, 10), "speed": (-2, 2), "tilt": (-0.5, 0.5), "position": (-30, 30)}
WEIGHTS = [2, 5, 0.1, 0.1], [0.05]


@pytest.fixture(scope="module")
def on_a_track():
    plant = cart_pole(BOUNDS)
    return plant, lpvmpc.certify(plant, T_S, *WEIGHTS, trials=0)


@pytest.mark.parametrize("horizon", [8, 25])
@pytest.mark.parametrize("kind", ["random", "huge", "to and fro", "steps"])
def test_set_points_may_be_anything(on_a_track, kind, horizon):
    plant, certificate = on_a_track
    mpc = lpvmpc.Mpc(plant, T_S, horizon, *WEIGHTS, terminal=certificate)
    generator = np.random.default_rng(horizon)
    x = edge(certificate, generator, 1)[0]
    goal = 0.0
    for k in range(60):
        if kind == "random" or (kind == "steps" and k % 20 == 0):
            goal = generator.uniform(-30, 30)
        elif kind != "steps":
            goal = (1e300 if kind == "huge" else 10.0) * (-1) ** k
        plan = mpc.step(x, [goal, 0, 0, 0])
        assert plan.is_guaranteed, f"{k}: {plan.status}"
        motion = exact(plant, x, plan.u[0])
        for name, values in (("position", motion[:, 0]), ("tilt", motion[:, 1]), ("speed", motion[:, 2])):
            assert abs(values).max() <= BOUNDS[name][1], f"{name} at {k}"
        assert abs(plan.u[0]) <= 10
        x = motion[-1]


def test_a_far_set_point_is_reached_as_fast_as_without_a_guarantee(on_a_track):
    plant, certificate = on_a_track

    def arrives(terminal, goal):
        mpc = lpvmpc.Mpc(plant, T_S, 30, *WEIGHTS, terminal=terminal)
        run = lpvmpc.simulate(plant, mpc, x0=[0, 0, 0, 0], duration=15.0, x_ref=[goal, 0, 0, 0])
        assert abs(run.x[-1, 0] - goal) < 1e-3
        return np.argmax(abs(run.x[:, 0] - goal) < 0.05 * goal) * T_S

    assert arrives(certificate, 12.0) < 1.1 * arrives("lqr", 12.0)


def drive(plant, certificate, told, count=100, change=30):
    """The cost of a loop on the plant, integrated to 1e-11, whose set point is told so many samples ahead."""
    reference = np.zeros((count + told + 1, 4))
    reference[change:, 0] = 4.0
    mpc = lpvmpc.Mpc(plant, T_S, 30, *WEIGHTS, terminal=certificate)
    x, cost, moved = np.zeros(4), 0.0, None
    for k in range(count):
        plan = mpc.step(x, reference[k : k + told + 1])
        assert plan.is_guaranteed, f"{k}: {plan.status}"
        e = x - reference[k]
        cost += e @ np.diag(WEIGHTS[0]) @ e + WEIGHTS[1][0] * plan.u0[0] ** 2
        motion = exact(plant, x, plan.u0)
        assert abs(motion[:, 1]).max() <= 0.5 and abs(motion[:, 2]).max() <= 2 and abs(plan.u0[0]) <= 10
        x = motion[-1]
        moved = k if moved is None and abs(x[0]) > 0.01 else moved
    assert abs(x[0] - 4.0) < 0.05
    return cost, moved


def test_a_set_point_that_is_told_ahead_costs_less(on_a_track):
    (late, after), (early, before) = drive(*on_a_track, told=0), drive(*on_a_track, told=30)
    assert early < 0.25 * late
    assert before < 30 <= after


def test_a_guaranteed_loop_behind_readings_tracks(on_a_track):
    plant, certificate = on_a_track
    estimator = lpvmpc.Estimator(
        measured={"position": 1e-6, "tilt": 1e-6}, state_noise=[1e-6, 1e-6, 1e-4, 1e-4],
        initial_state=1e-4, disturbances={"force": lpvmpc.Disturbance(noise=1.0)}, delay=T_S,
    )  # fmt: skip

    def run(estimator):
        mpc = lpvmpc.Mpc(plant, T_S, 20, *WEIGHTS, terminal=certificate, estimator=estimator)
        # Half a newton from the side, as it acts on an upright pole.
        load = plant.f(np.zeros(4), [0.5])
        sensors = {name: lpvmpc.Sensor(noise=1e-3) for name in ("position", "tilt")}
        return lpvmpc.simulate(
            plant, mpc, x0=np.zeros(4), duration=9.0, x_ref=lambda t: [0.0 if t < 2 else 1.0, 0, 0, 0],
            sensors=sensors, delay=T_S, disturbances=[lpvmpc.Load(1.0, np.inf, load)],
        )  # fmt: skip

    found = run(estimator)
    assert sum(plan.is_guaranteed for plan in found.plans) >= 0.95 * len(found.plans)
    assert abs(found["position"][-20:].mean() - 1.0) < 0.02
    assert abs(found.disturbances["force"][-20:].mean() - 0.5) < 0.1
    assert abs(found.u).max() <= 10
    # Without the disturbance in its model it stands aside.
    unaware = run(lpvmpc.Estimator(**{**vars(estimator), "disturbances": {}}))
    assert abs(unaware["position"][-20:].mean() - 1.0) > 0.03


def test_what_an_estimator_and_a_certificate_have_no_meaning_for_is_refused(on_a_track):
    plant, certificate = on_a_track
    moving = lpvmpc.Estimator({"position": 1e-6, "tilt": 1e-6}, 1e-4, {"speed": lpvmpc.Disturbance(0.1)})
    with pytest.raises(lpvmpc.SettingError, match=r"speed is a state.*beside an input \(force\)"):
        lpvmpc.Mpc(plant, T_S, 20, *WEIGHTS, terminal=certificate, estimator=moving)
    mpc = lpvmpc.Mpc(
        plant, T_S, 20, *WEIGHTS, terminal=certificate,
        estimator=lpvmpc.Estimator({"position": 1e-6, "tilt": 1e-6}, 1e-4),
    )  # fmt: skip
    plan = mpc.decide()
    assert not plan.is_guaranteed and plan.message.startswith("not guaranteed: ") and abs(plan.u0[0]) <= 10
    # A pole that lies too far over: nothing leads into the set, and the plan says so.
    mpc.observe(0.0, [0.0, 1.2])
    plan = mpc.decide([[0, 0, 0, 0], [1, 0, 0, 0]])
    assert not plan.is_guaranteed and plan.message.startswith("not guaranteed, "), plan
    with pytest.raises(lpvmpc.SettingError, match="disturbance: .* nothing else that is ahead"):
        mpc.decide(disturbance=[0, 0, 0, 0])


def test_a_plant_that_notices_where_it_stands_has_no_other_set_points():
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    spring = lpvmpc.Plant.from_casadi(x, u, ca.vertcat(x[1], u - x[0]), states=["position", "speed"])
    certificate = lpvmpc.certify(spring, 0.1, [1, 1], [1], u_bounds=([-1], [1]))
    mpc = lpvmpc.Mpc(spring, 0.1, 10, [1, 1], [1], u_bounds=([-1], [1]), terminal=certificate)
    with pytest.raises(lpvmpc.SettingError, match="position is 0.1.* reads: no state"):
        mpc.step([0, 0], x_ref=[0.1, 0])


def test_tyres_by_arctan_are_certified():
    # A bicycle at 20 m/s: distance from the line, heading, speed aside, yaw rate; tyres by Pacejka's formula.
    x, u = ca.SX.sym("x", 4), ca.SX.sym("steering")

    def force(slip):
        return 9e3 * ca.sin(1.3 * ca.atan(10 * slip))

    front, rear = force(u - ca.atan2(x[2] + 1.2 * x[3], 20)), force(-ca.atan2(x[2] - 1.5 * x[3], 20))
    turning = (1.2 * front * ca.cos(u) - 1.5 * rear) / 2500
    xdot = ca.vertcat(20 * ca.sin(x[1]) + x[2] * ca.cos(x[1]), x[3], (front * ca.cos(u) + rear) / 1500 - 20 * x[3], turning)
    car = lpvmpc.Plant.from_casadi(
        x, u, xdot, states=["aside", "heading", "slipping", "yaw_rate"],
        bounds={"slipping": (-0.3, 0.3), "yaw_rate": (-0.12, 0.12), "steering": (-0.1, 0.1)},
    )  # fmt: skip
    certificate = lpvmpc.certify(car, T_S, [1, 1, 0.1, 1], [50], trials=0)
    check(car, certificate, 60)
    assert certificate.state_limits[2] > 0.1


def test_a_plant_in_discrete_time_is_certified_as_it_is():
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    grown = ca.vertcat(5 * x[1] * ca.exp(-0.01 * x[1]), 0.5 * x[0] + 0.6 * x[1] - u)
    salmon = lpvmpc.Plant.from_casadi(
        x, u, grown, states=["young", "old"], inputs=["catch"], period=1.0,
        bounds={"young": (40, 300), "old": (40, 200), "catch": (0, 120)},
        equilibrium=([183.939720586, 100], [51.969860293]),
    )  # fmt: skip
    certificate = lpvmpc.certify(salmon, 1.0, [0.1, 1], [1])
    assert lpvmpc.verify(certificate, salmon).boxes == certificate.boxes
    assert certificate.state_limits[1] > 40
    for x in edge(certificate, np.random.default_rng(5), 200):
        for _ in range(30):
            u, e = certificate(0.0, x), x - certificate.x
            assert 0 <= u[0] <= 120
            assert (abs(e) <= certificate.state_limits).all()
            stage = e @ certificate.q @ e + (u - certificate.u) @ certificate.r @ (u - certificate.u)
            before, x = certificate.value(x), salmon.f(x, u)
            assert certificate.value(x) <= (1 - certificate.contraction) * before - stage + 1e-9 * (1 + before)
    mpc = lpvmpc.Mpc(salmon, 1.0, 8, [0.1, 1], [1], terminal=certificate)
    x, costs = np.array([120.0, 50.0]), []
    for _ in range(15):
        plan = mpc.step(x)
        assert plan.is_guaranteed
        costs.append(plan.cost)
        x = salmon.f(x, plan.u[0])
    assert (np.diff(costs) <= 1e-9).all()
    assert abs(x - certificate.x).max() < 0.1


def test_a_plant_with_a_kink_at_rest_is_certified():
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    plant = lpvmpc.Plant.from_casadi(x, u, 0.5 * ca.fabs(x) + u, states=["x"], inputs=["u"], bounds={"u": (-1, 1)})
    certificate = lpvmpc.certify(plant, 0.1, [1], [1])
    lpvmpc.verify(certificate, plant)
    # On either side of the kink.
    assert certificate.contains([0.2]) and certificate.contains([-0.2])


def test_what_has_no_proof_is_refused():
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    jumping = lpvmpc.Plant.from_casadi(x, u, ca.sign(x) * x + u)
    with pytest.raises(lpvmpc.PlantError, match="no proof can be had of `sign`: it jumps"):
        lpvmpc.certify(jumping, 0.1, [1], [1])
    with pytest.raises(lpvmpc.SettingError, match="t_s: it is -1 s"):
        lpvmpc.certify(double_integrator(), -1, [1, 1], [1])
    with pytest.raises(lpvmpc.SettingError, match="must lie between"):
        lpvmpc.certify(double_integrator(), 0.1, [1, 1], [1], x_bounds={"speed": (0, 1)})


def test_a_plant_that_begins_without_a_plan_is_stopped_first(on_a_track):
    plant, certificate = on_a_track
    mpc = lpvmpc.Mpc(plant, T_S, 20, *WEIGHTS, terminal=certificate)
    x = np.array([12.0, -0.48, 0.0, -0.25])
    decisions = []
    for _ in range(80):
        plan = mpc.step(x, [-23.0, 0, 0, 0])
        decisions.append(plan.is_guaranteed)
        assert abs(plan.u[0]) <= 10
        x = exact(plant, x, plan.u[0])[-1]
    first = decisions.index(True)
    assert 5 < first < 70 and all(decisions[first:])
