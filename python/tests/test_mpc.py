"""Controllers, against programs that share no code with them."""

import copy
import pickle
from collections import namedtuple
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pandas as pd
import pytest

import lpvmpc
from plants import cart_pole, cart_pole_formulas, double_integrator, hovering

Q, R, T_S, N = np.diag([2.0, 5.0, 0.2, 0.2]), np.diag([0.05]), 0.05, 25


def rk4(f, x, u, t_s):
    k1 = f(x, u)
    k2 = f(x + t_s / 2 * k1, u)
    k3 = f(x + t_s / 2 * k2, u)
    k4 = f(x + t_s * k3, u)
    return x + t_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def by_ipopt(x0, p, references):
    """The optimal inputs and their cost for the cart-pole, by multiple shooting and IPOPT."""
    x, u, parameters, f, values = cart_pole_formulas()
    rate = ca.Function("f", [x, u], [ca.substitute(f, parameters, ca.DM(list(values.values())))])
    opti = ca.Opti()
    xs, us = opti.variable(4, N + 1), opti.variable(1, N)
    cost = 0
    opti.subject_to(xs[:, 0] == x0)
    for k in range(N):
        e = xs[:, k] - references[k]
        cost += ca.bilin(ca.DM(Q), e, e) + R[0, 0] * us[k] ** 2
        opti.subject_to(xs[:, k + 1] == rk4(rate, xs[:, k], us[k], T_S))
        opti.subject_to(opti.bounded(-15, us[k], 15))
    e = xs[:, N] - references[N]
    cost += ca.bilin(ca.DM(p), e, e)
    opti.minimize(cost)
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "tol": 1e-10, "sb": "yes"})
    solution = opti.solve()
    return solution.value(us), solution.value(cost)


@pytest.mark.parametrize(
    ("x0", "steps"),
    [
        ([0, 0.5, 0, 0], [0.0]),
        ([0.3, -0.6, -1, 1], [0.0]),
        ([0, 0, 0, 0], [0.8]),
        ([-0.5, 0.3, 0.5, -0.5], [0.0] * 10 + [0.5] * 16),
    ],
)
def test_a_converged_plan_is_that_of_ipopt(x0, steps):
    plant = cart_pole()
    p = lpvmpc.lqr(plant, T_S, Q, R).p
    mpc = lpvmpc.Mpc(plant, T_S, N, Q, R, terminal=p, u_ref=[0.0], max_programs=60, tolerance=1e-12)
    x_ref = np.array([[position, 0, 0, 0] for position in steps])
    plan = mpc.step(x0, x_ref)
    every = np.vstack([x_ref, np.repeat(x_ref[-1:], N + 1 - len(x_ref), axis=0)])
    inputs, cost = by_ipopt(np.array(x0), p, every)
    assert plan.is_solved
    assert plan.cost == pytest.approx(cost, rel=1e-6)
    np.testing.assert_allclose(plan.u[:, 0], inputs, atol=2e-3)


def test_the_plan_is_a_motion_of_the_plant():
    plant = cart_pole()
    plan = lpvmpc.Mpc(plant, T_S, N, Q, R).step([0, 0.4, 0, 0])
    assert plan.u.shape == (N, 1) and plan.x.shape == (N + 1, 4)
    for i in range(N):
        after = rk4(plant.f, plan.x[i], plan.u[i], T_S)
        np.testing.assert_allclose(plan.x[i + 1], after, rtol=1e-9, atol=1e-9)
    assert (plan.u0 == plan.u[0]).all()


def test_without_bounds_a_linear_plant_is_under_its_regulator():
    plant = double_integrator()
    q, r = [1.0, 0.1], [0.5]
    regulator = lpvmpc.lqr(plant, 0.1, q, r)
    mpc = lpvmpc.Mpc(plant, 0.1, 10, q, r)
    for x in ([1, 0], [-2, 3]):
        np.testing.assert_allclose(mpc.step(x).u0, regulator(0.0, x), rtol=1e-9)
        assert mpc.step(x).cost == pytest.approx(np.array(x) @ regulator.p @ np.array(x))


def test_the_regulator_solves_the_riccati_equation_of_scipy():
    from scipy.linalg import expm, solve_discrete_are

    plant = cart_pole()
    a, b = plant.jacobian([0] * 4, [0])
    both = expm(np.block([[a, b], [np.zeros((1, 5))]]) * T_S)
    a_d, b_d = both[:4, :4], both[:4, 4:]
    p = solve_discrete_are(a_d, b_d, Q, R)
    found = lpvmpc.lqr(plant, T_S, Q, R)
    np.testing.assert_allclose(found.p, p, rtol=1e-8)
    k = np.linalg.solve(R + b_d.T @ p @ b_d, b_d.T @ p @ a_d)
    np.testing.assert_allclose(found.k, k, rtol=1e-8)


def test_an_infeasible_problem_is_said_in_the_plant_s_names():
    plant = double_integrator()
    mpc = lpvmpc.Mpc(
        plant, 0.1, 20, [1, 1], [1], u_bounds=([-1], [1]), x_bounds={"position": (None, 0.5)},
        state_bounds="hard",
    )  # fmt: skip
    # Stage 1 is out of reach already: 0.4 + 0.1 * 2 - 0.1**2 / 2 = 0.595.
    plan = mpc.step([0.4, 2.0])
    assert plan.status == "infeasible" and not plan.is_solved
    assert plan.message == "infeasible: position <= 0.5 at stage 1 against force >= -1 at stage 0"
    # Stopping takes 1.5**2 / 2 = 1.125.
    plan = mpc.step([0.0, 1.5])
    assert plan.status == "infeasible" and not plan.is_solved
    assert plan.message.startswith("infeasible: position <= 0.5 at stage")
    assert "against force >= -1 at stages 0 to" in plan.message
    assert (np.abs(plan.u) <= 1).all()
    assert mpc.step([0.0, 0.0]).is_solved


def test_soft_bounds_are_exceeded_at_their_price():
    plant = double_integrator()
    limits = {"position": (None, 0.5)}
    excess = []
    for price in (0.1, 1.0, 1e4):
        mpc = lpvmpc.Mpc(
            plant, 0.1, 20, [1, 0.1], [1], u_bounds=([-1], [1]), x_bounds=limits,
            state_bounds={"position": lpvmpc.Penalty(price, price)},
        )  # fmt: skip
        plan = mpc.step([0.4, 0.6], [1, 0])
        assert plan.is_solved
        excess.append(plan.x[:, 0].max() - 0.5)
    assert excess[0] > excess[1] > excess[2] > 0
    assert any(one.exceeded for one in plan.active)


def test_bounds_of_a_step_may_be_given_by_name():
    plant = cart_pole({"force": (-15, 15)})
    x_ref = [0.5, 0, 0, 0]

    def plan(x_bounds, u_bounds):
        mpc = lpvmpc.Mpc(plant, T_S, N, Q, R)
        return mpc.step([0] * 4, x_ref, x_bounds=x_bounds, u_bounds=u_bounds)

    low = [-np.inf] * 4
    by_name = plan({"position": (None, 0.1)}, {"force": (-4, 4)})
    by_place = plan((low, [0.1, np.inf, np.inf, np.inf]), ([-4], [4]))
    assert (by_name.u == by_place.u).all()
    assert by_name.x[:, 0].max() < 0.1 + 1e-6 and abs(by_name.u).max() <= 4
    assert plan(None, None).x[:, 0].max() > 0.11


@pytest.mark.parametrize("absent", [None, [None], np.array([None]), [-np.inf], {"force": (None, 0.5)}])
def test_none_is_no_bound(absent):
    """A whole side of None, or of objects, was NaN."""
    bounds = absent if isinstance(absent, dict) else (absent, [0.5])
    mpc = lpvmpc.Mpc(double_integrator(), 0.1, 20, [1, 0.1], [0.01], u_bounds=bounds)
    told = lpvmpc.Mpc(double_integrator(), 0.1, 20, [1, 0.1], [0.01])
    plan = mpc.step([0, 0], [1, 0])
    assert mpc.bounds["force"] == (-np.inf, 0.5)
    assert (told.step([0, 0], [1, 0], u_bounds=bounds).u == plan.u).all()
    assert plan.u.max() == pytest.approx(0.5) and plan.u.min() < -0.6
    told.reset()
    free = told.step([0, 0], [1, 0], u_bounds=([[None]] * 4, None))
    told.reset()
    assert (told.step([0, 0], [1, 0]).u == free.u).all() and free.u.max() > 0.6


def test_a_step_s_bounds_by_name_leave_the_others_as_they_are():
    """They gave those of the plant, or none, to whatever was not named."""
    plant = lpvmpc.Plant.from_matrices(
        [[-1, 0], [0, -1]], np.eye(2), np.eye(2), states=["v", "w"], inputs=["a", "b"], outputs=["y", "z"],
        bounds={name: (-9, 9) for name in "abvwyz"},
    )  # fmt: skip
    kept = {
        "x_bounds": {"v": (-0.5, 0.5), "w": (-0.5, 0.5)}, "u_bounds": ([-1, -1], [1, 1]),
        "y_bounds": {"y": (-0.4, 0.4), "z": (-0.4, 0.4)}, "du_bounds": np.array([[-0.2, -0.2], [0.2, 0.2]]),
    }  # fmt: skip
    mpc = lpvmpc.Mpc(plant, 0.1, 30, [1, 1], [0.01, 0.01], state_bounds="hard", **kept)

    def plan(**told):
        mpc.reset()
        return mpc.step([0, 0], [5, 5], u_ref=[0, 0], **told)

    assert mpc.bounds["a"] == (-1, 1) and mpc.bounds["z"] == (-0.4, 0.4)
    for name, by_name, by_place in (
        ("x_bounds", {"v": (-0.3, 0.3)}, ([-0.3, -0.5], [0.3, 0.5])),
        ("u_bounds", {"a": (None, 0.35)}, ([-np.inf, -1], [0.35, 1])),
        ("y_bounds", {"y": (-0.2, 0.2)}, ([-0.2, -0.4], [0.2, 0.4])),
        ("du_bounds", {"a": (-0.05, 0.05)}, ([-0.05, -0.2], [0.05, 0.2])),
    ):
        told = plan(**{name: by_name})
        assert (told.u == plan(**{name: by_place}).u).all() and (told.u != plan().u).any()
        assert (plan(**{name: {}}).u == plan().u).all()


def test_a_row_holds():
    plant = double_integrator()
    row = lpvmpc.Row("braking", x={"position": 1, "speed": 1}, upper=0.7)
    mpc = lpvmpc.Mpc(plant, 0.1, 20, [1, 0.1], [0.01], rows=[row], u_bounds=([-2], [2]))
    plan = mpc.step([0, 0], [1, 0])
    assert (plan.x[1:-1].sum(axis=1) <= 0.7 + 1e-8).all()
    assert "braking <= 0.7" in plan.active_bounds
    free = mpc.step([0, 0], [1, 0], rows=[[]])
    assert free.x.sum(axis=1).max() > 0.71


def test_bounds_weights_and_disturbances_by_stage():
    plant = double_integrator()
    mpc = lpvmpc.Mpc(plant, 0.1, 20, [1, 0.1], [0.1])
    lower = np.full((20, 1), -1.0)
    upper = np.concatenate([np.full((5, 1), 0.2), np.full((15, 1), 1.0)])
    plan = mpc.step([0, 0], [3, 0], u_bounds=(lower, upper))
    assert (plan.u[:5] <= 0.2 + 1e-12).all() and plan.u[5:].max() > 0.5
    assert (mpc.step([0, 0], [3, 0], u_bounds=([None], [0.1])).u <= 0.1 + 1e-12).all()
    gust = np.zeros((10, 2))
    gust[5:, 1] = 0.4
    told = mpc.step([0, 0], disturbance=gust)
    np.testing.assert_allclose(told.x[1:, 1] - told.x[:-1, 1] - 0.1 * told.u[:, 0],
                               [0.0] * 5 + [0.04] * 15, atol=1e-9)  # fmt: skip
    dear = mpc.step([0, 0], [3, 0], q=[1, 0.1], r=[10.0])
    assert np.abs(dear.u0) < np.abs(mpc.step([0, 0], [3, 0]).u0)


@pytest.mark.parametrize("settings", [{}, {"terminal": "equality"}, {"r_du": [0.1]}])
@pytest.mark.parametrize("u_ref", [{}, {"u_ref": [0.0]}])
def test_what_is_beyond_the_horizon_is_not_read(settings, u_ref):
    """The last row of a reference counted at the end of the horizon, however late it was."""
    horizon = 20
    x_ref = np.zeros((61, 2))
    x_ref[horizon - 1 :, 0] = [0.1, 0.2] + [0.3] * 40

    def plan(x_ref, **told):
        mpc = lpvmpc.Mpc(double_integrator(), 0.1, horizon, [1, 0.1], [0.01], **settings)
        return mpc.step([0, 0], x_ref, **told)

    seen = plan(x_ref[: horizon + 1], **u_ref)
    assert (plan(x_ref, **u_ref).u == seen.u).all()
    if settings:
        return
    # One row less: its last one is the end's, too.
    short = plan(x_ref[:horizon], **u_ref)
    assert (plan(np.vstack([x_ref[:horizon], x_ref[horizon - 1]]), **u_ref).u == short.u).all()
    assert abs(short.x[-1, 0] - seen.x[-1, 0]) > 0.01


def test_bounds_and_inputs_beyond_the_horizon_are_not_read():
    mpc = lpvmpc.Mpc(double_integrator(), 0.1, 20, [1, 0.1], [0.01], r_du=[0.1])
    beyond = np.array([[0.0]] * 20 + [[5.0]] * 20)
    narrow = np.array([[9.0, 9.0]] * 21 + [[1e-3, 1e-3]] * 20)
    free = mpc.step([0, 0], [1, 0], u_ref=[0.0], x_bounds=(-narrow[:21], narrow[:21]))
    mpc.reset()
    told = mpc.step([0, 0], [1, 0], u_ref=beyond, x_bounds=(-narrow, narrow))
    assert (told.u == free.u).all()


def test_weights_that_are_symmetric_up_to_rounding_are_taken():
    """They were refused, those of a step without a word but that of the plan's status."""
    q = np.array([[1.0, 0.1], [0.1 + 1e-12, 1.0]])
    even = (q + q.T) / 2
    mpc, other = (lpvmpc.Mpc(double_integrator(), 0.1, 10, one, [0.5], terminal=5 * one) for one in (q, even))
    assert mpc.step([1, 0]).u.tolist() == other.step([1, 0]).u.tolist()
    mpc, other = (lpvmpc.Mpc(double_integrator(), 0.1, 10, [1, 1], [0.5], terminal=even) for _ in range(2))
    plan = mpc.step([1, 0], q=[np.eye(2), q], r=[0.5])
    assert plan.is_solved
    assert plan.u.tolist() == other.step([1, 0], q=[np.eye(2), even], r=[0.5]).u.tolist()
    with pytest.raises(lpvmpc.SettingError, match=r"terminal cost: P is not symmetric"):
        mpc.set(terminal=[[1, 0.1], [0.2, 1]])


def test_linear_costs_against_the_normal_equations():
    """The condensed problem of a linear plant without bounds, solved densely."""
    q, r, t_s, horizon = np.diag([1.0, 0.1]), 0.1, 0.1, 12
    plant = double_integrator()
    p = lpvmpc.lqr(plant, t_s, q, [r]).p
    a, b = np.array([[1, t_s], [0, 1]]), np.array([t_s**2 / 2, t_s])
    powers = [np.linalg.matrix_power(a, i) for i in range(horizon + 1)]
    to_x = np.zeros((horizon, 2, horizon))
    for i in range(horizon):
        for j in range(i + 1):
            to_x[i, :, j] = powers[i - j] @ b
    x0, linear_x, linear_u = np.array([0.5, -1.0]), np.array([0.3, -0.7]), 0.4
    hessian, gradient = 2 * r * np.eye(horizon), np.full(horizon, linear_u)
    for i in range(horizon):
        weight = q if i + 1 < horizon else p
        hessian += 2 * to_x[i].T @ weight @ to_x[i]
        gradient += 2 * to_x[i].T @ weight @ powers[i + 1] @ x0
        if i + 1 < horizon:
            gradient += to_x[i].T @ linear_x
    expected = np.linalg.solve(hessian, -gradient)
    mpc = lpvmpc.Mpc(plant, t_s, horizon, q, [r], max_programs=20, tolerance=1e-12)
    stages = np.vstack([np.tile(linear_x, (horizon, 1)), np.zeros((1, 2))])
    plan = mpc.step(x0, linear_x=stages, linear_u=[linear_u])
    np.testing.assert_allclose(plan.u[:, 0], expected, atol=1e-8)


def test_settings_change_while_it_runs():
    plant = cart_pole()
    mpc = lpvmpc.Mpc(plant, T_S, N, Q, R)
    mpc.step([0, 0.3, 0, 0])
    mpc.set(u_bounds={"force": (-3, 3)}, r=[1.0])
    mpc.reset()
    fresh = lpvmpc.Mpc(plant, T_S, N, Q, [1.0], u_bounds=([-3], [3]))
    assert (mpc.step([0, 0.3, 0, 0]).u == fresh.step([0, 0.3, 0, 0]).u).all()
    assert mpc.bounds["force"] == (-3.0, 3.0) and mpc.settings["r"] == [1.0]
    with pytest.raises(lpvmpc.SettingError, match="horizon: it stays"):
        mpc.set(horizon=3)
    with pytest.raises(lpvmpc.SettingError, match="weight: there is no such setting"):
        mpc.set(weight=3)
    with pytest.raises(lpvmpc.SettingError):
        mpc.set(r=[-1.0])
    assert mpc.settings["r"] == [1.0]


def test_parameters_change_while_it_runs():
    mpc = lpvmpc.Mpc(cart_pole(), T_S, N, Q, R, terminal=Q)
    mpc.set_parameters(pole_mass=0.6)
    other = lpvmpc.Mpc(cart_pole().with_parameters(pole_mass=0.6), T_S, N, Q, R, terminal=Q)
    found = mpc.step([0, 0.3, 0, 0])
    np.testing.assert_allclose(found.u, other.step([0, 0.3, 0, 0]).u, atol=1e-9)
    assert mpc.plant.parameters["pole_mass"] == 0.6
    before = lpvmpc.Mpc(cart_pole(), T_S, N, Q, R, terminal=Q)
    values = [1.0, 0.6, 0.5]
    told = before.step([0, 0.3, 0, 0], parameters=values)
    np.testing.assert_allclose(told.u, found.u, atol=1e-9)
    with pytest.raises(lpvmpc.PlantError, match="mass"):
        mpc.set_parameters(mass=1)


def test_parameters_of_a_step_are_checked_as_others_are():
    """A pole too fast for the steps of the prediction made a plan that was nonsense."""
    x, u, rate = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("rate")
    plant = lpvmpc.Plant.from_casadi(x, u, u - rate * x, p=rate, parameters=[1.0])
    mpc = lpvmpc.Mpc(plant, 0.1, 10, [1], [1])
    coarse = "substeps: with 1 in 0.1 s .* at least 4 substeps are needed"
    with pytest.raises(lpvmpc.SettingError, match=coarse):
        mpc.set_parameters(rate=100.0)
    for parameters in ([100.0], [[1.0]] * 9 + [[100.0]]):
        for _ in range(2):
            with pytest.raises(lpvmpc.SettingError, match=coarse):
                mpc.step([1.0], parameters=parameters)
        assert mpc.step([1.0], parameters=[[1.0]] * 10 + [[100.0]]).is_solved
    assert mpc.step([1.0], parameters=[100.0], matrices=([[0.5]], [[0.1]])).is_solved
    mpc.set(substeps=4)
    assert mpc.step([1.0], parameters=[100.0]).is_solved


def test_a_state_that_is_not_finite_gets_an_input_that_is():
    mpc = lpvmpc.Mpc(cart_pole(), T_S, N, Q, R)
    for bad in (np.nan, np.inf):
        plan = mpc.step([0, bad, 0, 0])
        assert plan.status == "not finite" and not plan.is_solved
        assert np.isfinite(plan.u).all() and (np.abs(plan.u) <= 15).all()
    assert mpc.step([0, 0.1, 0, 0]).is_solved


def test_a_controller_can_be_pickled():
    mpc = lpvmpc.Mpc(cart_pole(), T_S, N, Q, R, x_bounds={"position": (-1, 1)})
    again = pickle.loads(pickle.dumps(mpc))
    assert (again.step([0, 0.3, 0, 0]).u == mpc.step([0, 0.3, 0, 0]).u).all()
    plan = pickle.loads(pickle.dumps(mpc.step([0, 0.3, 0, 0])))
    assert plan.is_solved and plan.x.shape == (N + 1, 4)


def test_copies_keep_the_terminal_cost_when_parameters_have_changed():
    """They designed it again, for the new parameters."""
    mpc = lpvmpc.Mpc(cart_pole(), T_S, 5, Q, R)
    mpc.set_parameters(pole_mass=0.9)
    x = [0, 0.3, 0, 0]
    for again in (pickle.loads(pickle.dumps(mpc)), copy.copy(mpc), copy.deepcopy(pickle.loads(pickle.dumps(mpc)))):
        mpc.reset()
        assert (again.step(x).u == mpc.step(x).u).all()
        assert again.plant == mpc.plant
    mpc.set(q=Q)  # which designs it for them
    designed = lpvmpc.Mpc(mpc.plant, T_S, 5, Q, R)
    assert (pickle.loads(pickle.dumps(mpc)).step(x).u == designed.step(x).u).all()
    assert (designed.step(x).u != again.step(x).u).any()


def test_an_equilibrium_goes_along_with_the_parameters():
    """The controller could not be copied, nor be set any more."""
    mpc = lpvmpc.Mpc(hovering(), 0.1, 10, [1, 1], [0.1], du_bounds=([-0.1], [0.1]))
    mpc.set_parameters(m=1.1)
    mpc.reset()
    for one in (mpc, pickle.loads(pickle.dumps(mpc)), copy.deepcopy(mpc)):
        assert one.plant == mpc.plant
        plan = one.step([2.0, 0.0])
        np.testing.assert_allclose(plan.u, 1.1 * 9.81, rtol=1e-9)
        np.testing.assert_allclose(plan.x, [[2, 0]] * 11, rtol=1e-9, atol=1e-12)
    mpc.set(q=[2, 1])
    fresh = lpvmpc.Mpc(hovering().with_parameters(m=1.1), 0.1, 10, [2, 1], [0.1], du_bounds=([-0.1], [0.1]))
    mpc.reset()
    assert (mpc.step([1.9, 0.0]).u == fresh.step([1.9, 0.0]).u).all()


def test_controllers_work_side_by_side():
    """The lock of the interpreter is let go; each thread has its own answers."""
    plant = cart_pole()
    starts = [[0, 0.1 * i, 0, 0] for i in range(1, 5)]

    def first(x):
        mpc = lpvmpc.Mpc(plant, T_S, N, Q, R)
        return [mpc.step(x).u0[0] for _ in range(50)]

    alone = [first(x) for x in starts]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(first, starts)) == alone


def make(**changes):
    settings = {"t_s": T_S, "horizon": N, "q": Q, "r": R, **changes}
    return lpvmpc.Mpc(cart_pole(), **settings)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: make(t_s=0), "t_s"),
        (lambda: make(t_s=float("nan")), "t_s"),
        (lambda: make(t_s="fast"), "t_s: it is 'fast'"),
        (lambda: make(t_s=10**400), "t_s: it is too large"),
        (lambda: make(horizon=0), "horizon"),
        (lambda: make(horizon=2.5), "horizon: it is 2.5"),
        (lambda: make(horizon=10**7), "horizon"),
        (lambda: make(q=[1, 1, 1]), r"q: its shape is \(3,\); it must be \(4,\)"),
        (lambda: make(q=[1, 1, 1, -1]), "not positive semidefinite"),
        (lambda: make(q=np.triu(np.ones((4, 4)))), "symmetric"),
        (lambda: make(q=[1, 1, 1, np.nan]), "finite"),
        (lambda: make(r=[0]), "positive definite"),
        (lambda: make(terminal="lqg"), "terminal: it is \"lqg\""),
        (lambda: make(terminal=[1, 1]), "terminal"),
        (lambda: make(u_bounds=([1], [-1])), "force"),
        (lambda: make(u_bounds=(np.nan, [1])), "u_bounds: force must lie from NaN to 1"),
        (lambda: make().set(t_s=np.array([0.1, 0.1])), r"t_s: it is array\(\[0.1, 0.1\]\); it must be a number"),
        (lambda: make().set(t_s=0.1), "t_s: it stays at 0.05; make another controller"),
        (lambda: make(u_bounds=3), r"u_bounds: it must be \(lower, upper\)"),
        (lambda: make(u_bounds=(np.ma.array([-1.0], mask=[1]), [1])), "u_bounds, lower: it has entries that are masked"),
        (lambda: make(u_bounds={"torque": (0, 1)}), "there is no 'torque'; there are force"),
        (lambda: make(x_bounds=([0], [1])), r"x_bounds, lower: its shape is \(1,\)"),
        (lambda: make(state_bounds="firm"), "state_bounds"),
        (lambda: make(state_bounds={"tilt": 3.0}), "no lpvmpc.Penalty"),
        (lambda: make(state_bounds={"tilt": lpvmpc.Penalty(-1.0)}), "not negative"),
        (lambda: make(rows=["a"]), "no lpvmpc.Row"),
        (lambda: make(rows=[lpvmpc.Row("a", x={"height": 1})]), "there is no 'height'"),
        (lambda: make(rows=[lpvmpc.Row("a", x=[1, 0, 0, 0], lower=2, upper=1)]), "a"),
        (lambda: make(linear_models="magic"), "linear_models"),
        (lambda: make(linear_models=None), "linear_models: it is None; it must be one of 'own', 'motion', 'ray'"),
        (lambda: make(state_bounds=None), "state_bounds: it is None"),
        (lambda: make(horizon=10**30), "from 1 to 1000"),
        (lambda: make(linear_models="ray", nodes=99), "nodes"),
        (lambda: make(nodes=0), "nodes: it is 0; it must be a whole number from 1 to 16"),
        (lambda: make(substeps=10**5), "substeps"),
        (lambda: make(rows=lpvmpc.Row("a", x=[1, 0, 0, 0], upper=1)), "rows: Row.* is not a list"),
        (lambda: make().set(rows=None), "rows: None is not a list of lpvmpc.Row"),
        (lambda: make().set(rows=lpvmpc.Row("a", x=[1, 0, 0, 0], upper=1)), "rows: Row.* is not a list"),
        (lambda: make(rows=[lpvmpc.Row("a", x=[1, 0, 0, 0])]), "neither a lower nor an upper bound"),
        (lambda: make(rows=[lpvmpc.Row("a", upper=1)]), "no coefficient"),
        (lambda: make().step([0] * 4, rows=[lpvmpc.Row("a", x=[1, 0, 0, 0], upper=1)]), "lists, one for each stage"),
        (lambda: make().step([0] * 4, scheduling=1.0), "scheduling"),
        (lambda: make().step([0] * 4, scheduling=[[1], [1, 2]]), "scheduling: .* is no array of real numbers"),
        (lambda: make().step([0] * 4, x_bounds={"height": (0, 1)}), "there is no 'height'"),
        (lambda: lpvmpc.lqr(cart_pole(), T_S, Q, R, x=[0, 0.2, 0, 0]), "does not stand where"),
        (lambda: lpvmpc.lqr(cart_pole(), "fast", Q, R), "t_s: it is 'fast'"),
        (lambda: make(substeps=0), "."),
        (lambda: make(method="newton"), "method"),
        (lambda: make(max_programs=0), "."),
        (lambda: make(tolerance=-1.0), "."),
        (lambda: lpvmpc.Mpc("plant", T_S, N, Q, R), "plant: str is no"),
        (lambda: make().step([0, 0]), "x: its shape"),
        (lambda: make().step(np.ma.array([0.0] * 4, mask=[0, 0, 0, 1])), "x: it has entries that are masked"),
        (lambda: make().step("up"), "x: 'up' is no array"),
        (lambda: make().step([10**400, 0, 0, 0]), "x: it is too large"),
        (lambda: make().step([0] * 4, [1, 2]), "x_ref: its shape"),
        (lambda: make().step([0] * 4, [np.nan] * 4), "x_ref, stage 0"),
        (lambda: make().step([0] * 4, np.zeros((0, 4))), "x_ref"),
        (lambda: make().step([0] * 4, q=Q), "both or neither"),
        (lambda: make().step([0] * 4, u_bounds=([1], [0])), "u_bounds, stage 0"),
        (lambda: make().step([0] * 4, parameters=[1.0]), "parameters"),
        (lambda: make().step([0] * 4, disturbance=[np.inf] * 4), "disturbance"),
        # 2 - 0.4**2 / 0.05 < 0; the plan was "refused", and kept the bounds of the settings instead of the step's.
        (lambda: make().step([0] * 4, u_bounds=([0.5], [0.8]), cross=[[0.4, 0, 0, 0]]), "cross, stage 0: .* Q - S'R"),
        (lambda: make().step([0] * 4, cross=[[0.3, 0, 0, 0]], q=[2 * np.eye(4), np.eye(4)], r=R), "cross, stage 1"),
    ],
)
def test_what_makes_no_sense_is_refused(call, message):
    with pytest.raises(lpvmpc.SettingError, match=message):
        call()


def test_the_largest_plant_that_fits():
    rng = np.random.default_rng(3)
    a = rng.normal(size=(16, 16)) * 0.2
    b = rng.normal(size=(16, 6))
    plant = lpvmpc.Plant.from_matrices(a, b)
    mpc = lpvmpc.Mpc(plant, 0.1, 200, np.ones(16), np.ones(6), u_bounds=([-1] * 6, [1] * 6))
    assert mpc.step(np.full(16, 0.5)).is_solved
    with pytest.raises(lpvmpc.SettingError, match="17 states"):
        big = lpvmpc.Plant.from_matrices(np.zeros((17, 17)), np.ones((17, 1)))
        lpvmpc.Mpc(big, 0.1, 5, np.ones(17), [1])


def test_multipliers_are_slopes_of_the_cost():
    """What a bound costs is what the cost falls by if it is moved."""

    def plan(limit):
        mpc = lpvmpc.Mpc(
            double_integrator(), 0.1, 20, [1, 0.1], [0.1], x_bounds={"speed": (-limit, limit)},
            state_bounds="hard", max_programs=40, tolerance=1e-13,
        )  # fmt: skip
        return mpc.step([0, 0], [3, 0])

    step = 1e-4
    slope = (plan(0.5 + step).cost - plan(0.5 - step).cost) / (2 * step)
    found = sum(one.multiplier for one in plan(0.5).active)
    assert found == pytest.approx(-slope, rel=1e-4)


def test_a_plan_is_found_where_the_regulator_leads_to_nothing_finite():
    """Far from its equilibrium the regulator asks for inputs under which the motion overflows."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    stiffening = lpvmpc.Plant.from_casadi(
        x, u, ca.vertcat(x[1], 4 * ca.sin(x[0]) + u * (1 + x[0] ** 4))
    )
    mpc = lpvmpc.Mpc(stiffening, 0.05, 30, [10, 1], [1e-4])
    plan = mpc.step([3.0, 0.0])
    assert plan.is_solved and np.isfinite(plan.x).all()
    assert np.abs(plan.x[-1]).max() < 0.1


def test_a_constant_reference_is_replaced_by_the_nearest_steady_state():
    """A cruise control: told nothing of the input, it stands, since no plant stands at a speed."""
    plant = lpvmpc.Plant.from_matrices(
        [[0, 1], [0, 0]], [[0], [1]], states=["position", "speed"], inputs=["force"], bounds={"force": (-1, 1)}
    )
    mpc = lpvmpc.Mpc(plant, 0.1, 20, [0, 1], [0.01], terminal=[0, 1])
    stands = mpc.step([0, 0], [0, 1])
    assert abs(stands.u).max() < 1e-9
    np.testing.assert_allclose(stands.x_target[1], 0, atol=1e-9)
    np.testing.assert_allclose(stands.u_target, [0], atol=1e-9)
    mpc.reset()
    drives = mpc.step([0, 0], [0, 1], u_ref=[0])
    assert drives.u0[0] == pytest.approx(1) and drives.x[-1, 1] == pytest.approx(1, abs=1e-3)
    assert drives.x_target is None and drives.u_target is None
    mpc = lpvmpc.Mpc(lpvmpc.Plant.from_matrices([[-0.5]], [[1]]), 0.1, 10, [1], [1])
    np.testing.assert_allclose(mpc.step([0], [2]).u_target, [1])
    np.testing.assert_allclose(mpc.step([0], [2]).x_target, [2])
    assert pickle.loads(pickle.dumps(mpc.step([0], [2]))).x_target == pytest.approx([2])


def test_changes_of_the_input_are_bounded_and_cost():
    mpc = lpvmpc.Mpc(double_integrator(), 0.1, 20, [1, 0.1], [0.01], du_bounds=([-0.3], [0.2]))
    mpc.set_last_input([0.5])
    plan = mpc.step([0, 0], [2, 0])
    changes = np.diff(np.concatenate([[0.5], plan.u[:, 0]]))
    assert (changes <= 0.2 + 1e-9).all() and (changes >= -0.3 - 1e-9).all()
    assert plan.u0[0] == pytest.approx(0.7)
    assert "change of force <= 0.2" in plan.active_bounds
    after = mpc.step(plan.x[1], [2, 0])
    assert after.u0[0] == pytest.approx(0.9)  # from what it gave
    swift = lpvmpc.Mpc(double_integrator(), 0.1, 20, [1, 0.1], [0.01]).step([0, 0], [2, 0])
    smooth = lpvmpc.Mpc(double_integrator(), 0.1, 20, [1, 0.1], [0.01], r_du=[1.0]).step([0, 0], [2, 0])
    assert np.abs(np.diff(smooth.u[:, 0])).max() < 0.5 * np.abs(np.diff(swift.u[:, 0])).max()


def test_outputs_are_tracked_and_bounded():
    """The height of a pole's tip, a nonlinear output, is kept; its position follows a reference."""
    settings = {"q_y": [20.0, 0.0], "y_bounds": ([None, 0.97], [None, None])}
    mpc = lpvmpc.Mpc(cart_pole(), T_S, 40, [0.01, 0.01, 0.2, 0.2], R, **settings)
    free = lpvmpc.Mpc(cart_pole(), T_S, 40, [0.01, 0.01, 0.2, 0.2], R, q_y=[20.0, 0.0])
    heights = []
    for one in (mpc, free):
        x = np.zeros(4)
        lowest = 1.0
        for _ in range(120):
            plan = one.step(x, y_ref=[1.0, 1.0])
            assert plan.is_solved
            x = plan.x[1]
            lowest = min(lowest, np.cos(x[1]))
        assert abs(x[0] + np.sin(x[1]) - 1.0) < 0.01
        heights.append(lowest)
    assert heights[0] > 0.969 > heights[1]


def test_matrices_by_stage_take_the_place_of_the_plant():
    mpc = lpvmpc.Mpc(double_integrator(), 0.1, 10, [1, 0.1], [0.5])
    a, b = np.array([[1, 0.1], [0, 1]]), np.array([[0.005], [0.1]])
    same = mpc.step([1, 0], matrices=(a, b))
    np.testing.assert_allclose(same.u, mpc.step([1, 0]).u, atol=1e-9)
    drift = mpc.step([1, 0], matrices=(a, np.tile(b, (10, 1, 1)), [0.0, 0.05]))
    np.testing.assert_allclose(drift.x[1], a @ [1, 0] + b[:, 0] * drift.u[0] + [0.0, 0.05], atol=1e-12)
    with pytest.raises(lpvmpc.SettingError, match="matrices, A: its shape"):
        mpc.step([1, 0], matrices=(np.eye(3), b))
    with pytest.raises(lpvmpc.SettingError, match=r"\(A, B\) or \(A, B, c\)"):
        mpc.step([1, 0], matrices=(a,))


def test_the_longest_of_the_matrices_says_how_many_stages_there_are():
    """Of a c by stage beside one A and one B only the first was taken."""
    mpc = lpvmpc.Mpc(double_integrator(), 0.1, 10, [1, 0.1], [0.5])
    a, b, c = np.array([[1, 0.1], [0, 1]]), np.array([[0.005], [0.1]]), [[0.0, 0.0], [0.0, 0.0], [0.0, -0.3]]
    plan = mpc.step([1, 0], matrices=(a, b, c))
    for i in range(10):
        after = a @ plan.x[i] + b @ plan.u[i] + c[min(i, 2)]
        np.testing.assert_allclose(plan.x[i + 1], after, atol=1e-12)


def test_what_was_given_may_change():
    plant = lpvmpc.Plant.from_matrices([[0, 1], [0, 0]], [[0], [1]], states=["place", "speed"])
    q, bounds = np.array([1.0, 0.1]), {"speed": (-0.5, 0.5)}
    mpc = lpvmpc.Mpc(plant, 0.1, 10, q, [0.01], u_bounds=([-2], [2]), x_bounds=bounds)
    untouched = lpvmpc.Mpc(plant, 0.1, 10, [1.0, 0.1], [0.01], u_bounds=([-1], [1]), x_bounds={"speed": (-0.5, 0.5)})
    # A named tuple is a tuple.
    mpc.set(u_bounds=namedtuple("Limits", "lower upper")([-2], [2]))
    q[0] = 99.0
    bounds["speed"] = (-0.1, 0.1)
    mpc.settings["q"][0] = 50.0
    mpc.set(u_bounds=([-1], [1]))
    assert mpc.bounds == untouched.bounds
    assert mpc.step([0.1, 0.0]).u0 == untouched.step([0.1, 0.0]).u0


def test_what_has_names_is_taken_by_them():
    """Series and DataFrames of pandas were taken by their order, whatever their names said."""
    plant = cart_pole()
    by_name = pd.Series({"rate": 0.1, "speed": -0.2, "tilt": 0.3, "position": 0.4})
    x = by_name[["position", "tilt", "speed", "rate"]].to_numpy()
    mpc = lpvmpc.Mpc(plant, T_S, N, Q, R, q_y=[0.1, 0.2], r_du=[0.1])

    def plan(x=x, *arguments, **told):
        mpc.reset()
        return mpc.step(x, *arguments, **told)

    moving = np.linspace(0, 1, N + 1)[:, None] * x
    table = pd.DataFrame(moving, columns=["position", "tilt", "speed", "rate"])
    turned = table[["tilt", "rate", "position", "speed"]].set_index(pd.Index(T_S * np.arange(N + 1), name="t"))
    assert (plan(by_name, turned).u == plan(x, moving).u).all()
    assert (plan(pd.Series(x), pd.DataFrame(moving)).u == plan(x, moving).u).all()
    parameters = pd.Series({"half_length": 0.6, "cart_mass": 1.1, "pole_mass": 0.2})
    of_y = ["tip_height", "tip_position"]
    cross = pd.DataFrame([[0.01, 0.02, 0.0, 0.03]], index=["force"], columns=table.columns)
    a = pd.DataFrame(np.eye(4) + T_S * np.diag([1.0, 1.0], 2), index=table.columns, columns=table.columns)
    b = pd.DataFrame([0, 0, T_S, -T_S], index=table.columns, columns=["force"])
    other = ["rate", "tilt", "position", "speed"]
    weights = pd.DataFrame(Q, index=by_name.index[::-1], columns=by_name.index[::-1])
    for named, numbers in (
        ({"parameters": parameters}, {"parameters": [1.1, 0.2, 0.6]}),
        ({"y_ref": pd.Series([0.9, 0.1], of_y)}, {"y_ref": [0.1, 0.9]}),
        ({"q_y": pd.Series([3.0, 0.2], of_y)}, {"q_y": [0.2, 3.0]}),
        ({"disturbance": by_name}, {"disturbance": x}),
        ({"q": by_name.abs(), "r": [0.1]}, {"q": abs(x), "r": [0.1]}),
        ({"q": weights.loc[by_name.index], "r": [0.1]}, {"q": Q, "r": [0.1]}),
        ({"x_bounds": (by_name - 9, pd.Series(x + 9))}, {"x_bounds": (x - 9, x + 9)}),
        ({"u_bounds": pd.Series({"force": (-3, 3)})}, {"u_bounds": {"force": (-3, 3)}}),
        ({"cross": cross[by_name.index]}, {"cross": cross.to_numpy()}),
        ({"matrices": (a.loc[by_name.index, other], b.loc[by_name.index], by_name)}, {"matrices": (a, b, x)}),
    ):
        assert (plan(**named).u == plan(**numbers).u).all()
    for told in ({"cross": cross.rename(columns={"tilt": "angle"})}, {"matrices": (a, b.rename(index={"tilt": "angle"}))}):
        with pytest.raises(lpvmpc.SettingError, match="its names are position, angle, speed, rate; they must be"):
            plan(**told)
    assert (plant.f(by_name, pd.Series({"force": 1.0})) == plant.f(x, [1.0])).all()
    for row in (pd.Series({"speed": 1.0}), pd.Series([0.0, 0, 1, 0])):
        told = plan(rows=[[lpvmpc.Row("slow", x=row, upper=0.1)]])
        assert (told.u == plan(rows=[[lpvmpc.Row("slow", x={"speed": 1}, upper=0.1)]]).u).all()
    for wrong, message in (
        (by_name.rename({"tilt": "angle"}), "x: its names are rate, speed, angle, position; they must be position, tilt"),
        (by_name[:3], "its names are rate, speed, tilt; they must be"),
        (pd.concat([by_name, by_name]), "its names are rate, speed"),
        (pd.Series(x, [1, 2, 3, 4]), "its names are 1, 2, 3, 4; they must be"),
    ):
        with pytest.raises(lpvmpc.SettingError, match=message):
            plan(wrong)


def test_a_law_has_arrays_of_its_own():
    """What a user changed later changed the law."""
    x, u = np.zeros(2), np.zeros(1)
    law = lpvmpc.lqr(double_integrator(), 0.1, [1, 1], [1], x=x, u=u)
    x[0], u[0] = 5.0, 7.0
    assert law.x.tolist() == [0, 0] and law(0.0, [0, 0]).tolist() == [0]


def test_laws_and_costs_take_vectors_of_their_size():
    plant = lpvmpc.Plant.from_matrices([[0, 1], [0, 0]], [[0], [1]])
    law = lpvmpc.lqr(plant, 0.1, [1, 1], [1])
    for wrong in (np.ones((2, 2)), [1, 2, 3], 1.0):
        with pytest.raises(lpvmpc.SettingError, match="x: its shape"):
            law(0.0, wrong)
    with pytest.raises(lpvmpc.SettingError, match="x: it has an entry"):
        lpvmpc.lqr(plant, 0.1, [1, 1], [1], x=[np.nan, 0])
    run = lpvmpc.simulate(plant, law, [0.1, 0.0], t_s=0.1, duration=1.0)
    assert run.cost([1, 1], [1], u_ref=[0.5]) != run.cost([1, 1], [1])
    for wrong in ([1, 1, 1], np.ones((3, 1))):
        with pytest.raises(lpvmpc.SettingError, match="u_ref"):
            run.cost([1, 1], [1], u_ref=wrong)


def test_a_plan_of_an_unstable_plant_does_not_depend_on_a_long_horizon() -> None:
    """The regulator within the input bounds runs away from here, to where nothing can be linearised; over 700 samples a step
    came to no end. The plan comes to rest within 200: its cost is the same, and IPOPT's (2198.1738)."""
    rng = np.random.default_rng(0)
    a = rng.normal(size=(16, 16)) * 0.3 - np.eye(16) * 0.2
    plant = lpvmpc.Plant.from_matrices(a, rng.normal(size=(16, 6)))
    x0 = rng.normal(size=16)
    for horizon in (200, 700):
        limits = ([-0.3] * 6, [0.3] * 6)
        mpc = lpvmpc.Mpc(plant, 0.05, horizon, np.ones(16), np.ones(6) * 0.1, u_bounds=limits)
        plan = mpc.step(x0)
        assert plan.status == "converged"
        assert plan.cost == pytest.approx(2198.1738, rel=1e-6)
        assert plan.programs <= 6
