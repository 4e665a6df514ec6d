"""Our closed loops beside those of nonlinear MPC that IPOPT converges at every sample.

`main` runs an example: it prints a table, writes it and the figure of the first start to a folder.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import lpvmpc
import numpy as np
from problem import Array, Example, Problem, Start, by_sample
from references import Converged, do_mpc_controller, references

DO_MPC_SAMPLES = 40
"""Samples of the first start in which do-mpc is timed."""
REPEATS = 3
"""Runs of our closed loop; the time of a sample is the shortest of them."""


@dataclass
class Row:
    """What came of a start."""

    start: str
    cost: float
    """Closed loop, the prices of exceeded bounds included."""
    ratio: float
    """Of this cost to the one of IPOPT's closed loop."""
    excess: float
    """The largest excess of a bound by a state, in parts of the bound's width."""
    excess_ipopt: float
    unsolved: int
    """Samples without a plan."""
    failures: int
    """Samples at which IPOPT did not converge."""
    median: float
    """Of a step, ms."""
    most: float
    """99 % of the steps take no more, ms."""
    median_ipopt: float
    most_ipopt: float
    programs: float
    """Quadratic programs per sample, mean."""


def our_run(example: Example, start: Start, duration: float | None = None) -> lpvmpc.Run:
    """The closed loop of the example's controller; the duration is the start's without another."""
    mpc, plant = example.mpc, example.mpc.plant
    duration = start.duration if duration is None else duration
    x0, u_ref = np.asarray(start.x0, dtype=float), start.u_ref
    if start.x_bounds is None and (u_ref is None or np.ndim(u_ref) < 2):
        return lpvmpc.simulate(plant, mpc, x0, duration, start.x_ref, u_ref=u_ref)
    mpc.reset()
    plans = []

    def control(t: float, x: Array) -> Array:
        i, ahead = round(t / mpc.t_s), mpc.horizon + 1
        known = {"u_ref": None if u_ref is None else by_sample(u_ref, i, mpc.horizon, mpc.t_s)}
        if start.x_bounds is not None:
            known["x_bounds"] = tuple(by_sample(one, i, ahead, mpc.t_s) for one in start.x_bounds)
        plans.append(mpc.step(x, by_sample(start.x_ref, i, ahead, mpc.t_s), **known))
        return plans[-1].u0

    run = lpvmpc.simulate(plant, control, x0, duration, start.x_ref, t_s=mpc.t_s)
    run.plans.extend(plans)
    run.bounds.update(mpc.bounds)
    return run


def closed_loop_cost(example: Example, problem: Problem, start: Start, run: lpvmpc.Run) -> float:
    """The stage costs of the run and the prices of the bounds that it exceeds."""
    t_s, count = example.mpc.t_s, len(run.u)
    x_ref, u_ref = references(example, start)
    e = run.x[:-1] - by_sample(x_ref, 0, count, t_s)
    v = run.u - by_sample(u_ref, 0, count, t_s)
    stages = np.einsum("ki,ij,kj", e, problem.q, e) + np.einsum("ki,ij,kj", v, problem.r, v)
    prices = np.where(np.isfinite(problem.prices), problem.prices, 0.0)
    return float(stages + (_excess(example, problem, start, run) @ prices).sum())


def _excess(example: Example, problem: Problem, start: Start, run: lpvmpc.Run) -> Array:
    bounds = None
    if start.x_bounds is not None:
        bounds = [by_sample(one, 1, len(run.u), example.mpc.t_s) for one in start.x_bounds]
    return problem.excess(run.x[1:], bounds)


def _largest(excess: Array, problem: Problem) -> float:
    width = problem.x_upper - problem.x_lower
    width = np.where(np.isfinite(width), width, np.fmax(abs(problem.x_lower), abs(problem.x_upper)))
    return float((excess / np.where(np.isfinite(width) & (width > 0), width, 1.0)).max(initial=0.0))


def compare(example: Example, start: Start, samples: int | None = None) -> tuple[Row, Any, Any]:
    """One start: the row, our run, and IPOPT's. With `samples`, only so many."""
    mpc, problem = example.mpc, Problem.of(example)
    duration = start.duration if samples is None else samples * mpc.t_s
    ours = our_run(example, start, duration)
    # The loop is the same every time: the shortest time of each sample is free of what else ran.
    repeats = [our_run(example, start, duration).step_times for _ in range(REPEATS - 1)]
    times = np.min([ours.step_times, *repeats], axis=0)
    converged = Converged(example)
    theirs = lpvmpc.simulate(
        mpc.plant, converged.controller(example, start), np.asarray(start.x0, dtype=float), duration,
        start.x_ref, t_s=mpc.t_s,
    )  # fmt: skip
    costs = [closed_loop_cost(example, problem, start, run) for run in (ours, theirs)]
    excess = [_largest(_excess(example, problem, start, run), problem) for run in (ours, theirs)]
    ms = 1e3
    row = Row(
        start=start.name, cost=costs[0], ratio=costs[0] / costs[1],
        excess=excess[0], excess_ipopt=excess[1],
        unsolved=sum(not plan.is_solved for plan in ours.plans), failures=converged.failures,
        median=ms * float(np.median(times)),
        most=ms * float(np.quantile(times, 0.99)),
        median_ipopt=ms * float(np.median(converged.times)),
        most_ipopt=ms * float(np.quantile(converged.times, 0.99)),
        programs=float(np.mean([plan.programs for plan in ours.plans])),
    )  # fmt: skip
    return row, ours, theirs


def do_mpc_times(example: Example, samples: int = DO_MPC_SAMPLES) -> tuple[float, float]:
    """Median and 99 % of a step of do-mpc in the first start, ms, without the very first."""
    start = example.starts[0]
    run = lpvmpc.simulate(
        example.mpc.plant, do_mpc_controller(example, start), np.asarray(start.x0, dtype=float),
        samples * example.mpc.t_s, start.x_ref, t_s=example.mpc.t_s,
    )  # fmt: skip
    times = 1e3 * run.step_times[1:]
    return float(np.median(times)), float(np.quantile(times, 0.99))


def main(example: Example, document: str | None = None) -> None:
    """Runs an example as a program."""
    arguments = argparse.ArgumentParser(description=document)
    arguments.add_argument("folder", nargs="?", default="out", help="where figure and table go")
    arguments.add_argument("--only", type=int, help="so many of the starts")
    options = arguments.parse_args()
    folder = Path(options.folder)
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    print(f"{example.title}: cost beside converged nonlinear MPC")
    print(f"{'start':28} {'cost':>11} {'ratio':>8} {'excess':>8} {'ours, ms':>14} {'IPOPT, ms':>14} programs")
    for start in example.starts[: options.only]:
        row, ours, _ = compare(example, start)
        if not rows:
            from figures import figure

            figure(example, ours).savefig(folder / f"{example.name}.png", dpi=130)
        rows.append(row)
        faults = f" {row.unsolved} unsolved" * (row.unsolved > 0) + f" {row.failures} IPOPT failed" * (
            row.failures > 0
        )
        print(
            f"{row.start:28} {row.cost:11.5g} {row.ratio:8.4f} {row.excess:8.1e} "
            f"{row.median:6.3f} {row.most:7.3f} {row.median_ipopt:6.1f} {row.most_ipopt:7.1f} "
            f"{row.programs:6.2f}{faults}", flush=True,
        )  # fmt: skip
    try:
        median, most = do_mpc_times(example)
        faster = median / rows[0].median
        print(f"do-mpc: {median:.1f} ms, 99 % {most:.1f} ms: {faster:.0f} times as long as ours")
    except ImportError:
        median = most = float("nan")
    result = {
        "name": example.name, "title": example.title, "do_mpc": [median, most],
        "states": problem_size(example)[0], "inputs": problem_size(example)[1],
        "horizon": example.mpc.horizon, "rows": [asdict(row) for row in rows],
    }  # fmt: skip
    (folder / f"{example.name}.json").write_text(json.dumps(result, indent=1) + "\n")


def problem_size(example: Example) -> tuple[int, int]:
    """States and inputs."""
    return len(example.mpc.plant.states), len(example.mpc.plant.inputs)
