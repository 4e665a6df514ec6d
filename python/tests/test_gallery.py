"""The examples, with a few samples of each comparison. Needs CasADi; do-mpc and MuJoCo where they are there."""

import importlib
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("casadi")
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
