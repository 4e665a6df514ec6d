"""The examples, with a few samples of each comparison. Needs CasADi; do-mpc and MuJoCo where they are there."""

import importlib
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

ca = pytest.importorskip("casadi")
sys.path.insert(0, str(Path(__file__).parent.parent / "examples"))

import compare  # noqa: E402
import lpvmpc  # noqa: E402
from problem import Problem, Start, by_sample  # noqa: E402
from references import Converged, references  # noqa: E402

EXAMPLES = [
    "aircraft", "arm_pendulum", "balancer", "cart_pole", "cstr", "four_tanks", "furuta",
    "mujoco_pendulum", "quadrotor", "race_car",
]  # fmt: skip
SAMPLES = 10
# The race car begins on its reference, where the first samples cost next to nothing.
STARTS = {"race_car": 3}


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_first_samples_cost_what_those_of_converged_nonlinear_mpc_cost(name):
    example = importlib.import_module(name).example()
    row, ours, theirs = compare.compare(example, example.starts[STARTS.get(name, 0)], SAMPLES)
    assert row.unsolved == 0 and row.failures == 0
    assert row.ratio < 1.01
    assert row.excess < row.excess_ipopt + 1e-4
    assert len(ours.u) == len(theirs.u) == SAMPLES


@pytest.mark.parametrize("name", ["cart_pole", "cstr", "four_tanks", "quadrotor"])
def test_steady_states_are_the_nearest_within_bounds(name):
    """From references that no plant can stand at, a third beyond their bounds: as near as IPOPT finds one."""
    example = importlib.import_module(name).example()
    plant, random = example.mpc.plant, np.random.default_rng(0)
    n = len(plant.states)
    x, u, xdot = (ca.vertcat(*one) if isinstance(one, list) else one for one in (example.x, example.u, example.xdot))
    x_ref = ca.SX.sym("x_ref", n)
    e = x - x_ref
    nlp = {"x": ca.vertcat(x, u), "p": x_ref, "f": ca.dot(e, e) + 1e-9 * ca.dot(u, u), "g": xdot}
    ipopt = ca.nlpsol("ipopt", "ipopt", nlp, {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False})
    signals = [*plant.states, *plant.inputs]
    lower = np.array([-np.inf if one.lower is None else one.lower for one in signals])
    upper = np.array([np.inf if one.upper is None else one.upper for one in signals])
    box = [np.where(np.isfinite(one), one, size)[:n] for one, size in ((lower, -1.5), (upper, 1.5))]
    for _ in range(20):
        target = (box[0] + box[1]) / 2 + (box[1] - box[0]) / 2 * random.uniform(-1.3, 1.3, n)
        ours = plant.steady_state(target)
        inside = np.clip(np.concatenate([target, np.zeros(len(plant.inputs))]), lower, upper)
        theirs = ipopt(x0=inside, p=target, lbx=lower, ubx=upper, lbg=0, ubg=0)
        assert ipopt.stats()["success"]
        found = theirs["x"].full().ravel()[:n]
        assert np.sum((ours.x - target) ** 2) < 1.001 * np.sum((found - target) ** 2) + 1e-6
        assert abs(plant.f(ours.x, ours.u)).max() < 1e-6 * (1 + abs(ours.x).max())


@pytest.mark.parametrize("name", EXAMPLES)
def test_both_controllers_sample_the_plant_alike(name):
    example = importlib.import_module(name).example()
    start = example.starts[0]
    x0 = np.asarray(start.x0, dtype=float)
    x_ref = by_sample(references(example, start)[0], 0, example.mpc.horizon + 1, example.mpc.t_s)
    plan = example.mpc.step(x0, x_ref, u_ref=start.u_ref)
    step = Problem.of(example).step
    for x, u, following in zip(plan.x[:8], plan.u[:8], plan.x[1:9], strict=True):
        assert np.allclose(step(x, u).full().ravel(), following, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("name", ["cart_pole", "furuta", "aircraft", "balancer"])
def test_a_plan_along_the_way_is_the_converged_one(name):
    example = importlib.import_module(name).example()
    start, mpc = example.starts[0], example.mpc
    run = compare.our_run(example, start, 4 * mpc.t_s)
    problem, converged = Problem.of(example), Converged(example)
    x_ref, u_ref = references(example, start)
    ahead = by_sample(x_ref, 0, mpc.horizon + 1, mpc.t_s)
    converged.solve(run.x[3], ahead, by_sample(u_ref, 0, mpc.horizon, mpc.t_s))
    prices = np.where(np.isfinite(problem.prices), problem.prices, 0.0)
    cost = run.plans[3].cost + (problem.excess(run.plans[3].x[1:]) @ prices).sum()
    assert converged.failures == 0
    assert abs(cost - converged.cost) < 1e-3 * converged.cost


def test_soft_bounds_have_the_prices_that_ipopt_pays():
    example = importlib.import_module("cart_pole").example()
    price = Problem.of(example).prices[0]

    def plan(state_bounds):
        settings = {**example.mpc.settings, "state_bounds": state_bounds}
        # It cannot stop before the end of the track.
        return lpvmpc.Mpc(example.mpc.plant, **settings).step([2.39, 0, 3, 0])

    soft = plan("soft")
    assert soft.x[:, 0].max() > 2.41
    assert np.allclose(plan({"position": lpvmpc.Penalty(price)}).u, soft.u, rtol=0, atol=1e-9)
    assert not np.allclose(plan({"position": lpvmpc.Penalty(price / 2)}).u, soft.u, rtol=0, atol=1e-3)


def test_hard_bounds_are_compared_as_hard_ones():
    example = importlib.import_module("cart_pole").example()
    settings = {**example.mpc.settings, "state_bounds": "hard"}
    hard = replace(example, mpc=lpvmpc.Mpc(example.mpc.plant, **settings))
    row, ours, _ = compare.compare(hard, Start("aside", [0, 0, 0, 0], 1, [1, 0, 0, 0]), SAMPLES)
    assert row.failures == 0 and abs(row.ratio - 1) < 1e-3 and ours.is_solved


def test_hard_bounds_are_kept_where_ipopt_keeps_them():
    """From starts whose first programs are infeasible, and from random ones; and of one no plan is known."""
    example = importlib.import_module("furuta").example()
    mpc = lpvmpc.Mpc(example.mpc.plant, **{**example.mpc.settings, "state_bounds": "hard"})
    hard = replace(example, mpc=mpc)
    problem, ipopt, random = Problem.of(hard), Converged(hard), np.random.default_rng(4)
    starts = [
        ([-0.742, -0.09, -1.908, -3.626], -1.74), ([-1.547, -0.548, -2.545, 2.708], -0.921),
        ([0.832, 0.389, 3.173, -0.247], -0.942), ([-1.351, -0.234, -1.395, -0.376], -1.182),
        *((random.uniform(-1, 1, 4) * [1.8, 0.8, 4, 4], random.uniform(-1.8, 1.8)) for _ in range(10)),
    ]  # fmt: skip
    for x0, arm in starts:
        target = np.array([arm, 0, 0, 0])
        mpc.reset()
        plan = mpc.step(x0, target, u_ref=[0])
        ipopt.plan = None
        ipopt.solve(np.asarray(x0), np.tile(target, (41, 1)), np.zeros((40, 1)))
        assert ipopt.failures == 0 and plan.is_solved
        assert problem.excess(plan.x[1:]).max() < 0.04 and plan.cost < 1.05 * ipopt.cost
        assert mpc.step(x0, target, u_ref=[0]).is_solved
    drone = importlib.import_module("quadrotor").example()
    mpc = lpvmpc.Mpc(drone.mpc.plant, **{**drone.mpc.settings, "state_bounds": "hard"})
    plan = mpc.step([-0.78, -0.119, 0.273, -1.45, 1.224, 5.671], [0.51, 0.096, 0, 0, 0, 0], u_ref=references(drone, drone.starts[0])[1])
    assert plan.status in ("infeasible", "exceeded")


def test_the_acados_model_is_swung_up():
    run = importlib.import_module("from_acados").main()
    assert run.is_solved and np.abs(run.x[-1]).max() < 1e-2


@pytest.mark.filterwarnings("ignore")  # those of do-mpc
def test_the_do_mpc_model_costs_the_same_under_both():
    pytest.importorskip("do_mpc")
    theirs, ours = importlib.import_module("from_do_mpc").main()
    assert abs(ours / theirs - 1) < 1e-3


def test_mujoco_pendulum_gets_from_end_to_end():
    gymnasium = pytest.importorskip("gymnasium")
    pytest.importorskip("mujoco")
    module = importlib.import_module("mujoco_pendulum")
    example = module.example()
    environment = gymnasium.make("InvertedPendulum-v5", max_episode_steps=1000)
    start = example.starts[0]
    x, _ = module.in_mujoco(environment, start, lambda t, x: example.mpc.step(x, start.x_ref).u0)
    assert abs(x[-1, 0] - start.x_ref[0]) < 0.02 and np.abs(x[:, 0]).max() < 0.91


def test_the_tanks_are_tracked_without_offset():
    offset_free = importlib.import_module("offset_free")
    off = {one: offset_free.run(one, 290).x[-1, :2] - offset_free.LEVELS for one in (False, True)}
    assert np.abs(off[False]).max() > 0.1
    assert np.abs(off[True]).max() < 1e-3
