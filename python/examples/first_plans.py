"""The first plans from many random starts beside IPOPT's: where does the method find a dearer minimum?

Of one sample, without a plan from before: harder than a closed loop, in which most samples begin with a good
one. ``python first_plans.py cart_pole 200``
"""

import argparse
import importlib

import lpvmpc
import numpy as np
from problem import Example, Problem, by_sample
from references import Converged, references

RANGES = {
    "cart_pole": ([2, 0.8, 2, 3], [2.2, 0, 0, 0]),
    "furuta": ([1.8, 0.8, 4, 4], [1.8, 0, 0, 0]),
    "balancer": ([10, 0.4, 8, 3], [10, 0, 0, 0]),
    "arm_pendulum": ([1.5, 0.5, 4, 4], [0, 0, 0, 0]),
    "quadrotor": ([0.8, 0.4, 1, 2, 2, 6], [0.9, 0.4, 0, 0, 0, 0]),
}
"""States are drawn within +- the first vector, set points within +- the second."""


def plan_cost(problem: Problem, plan: lpvmpc.Plan, x_ref, u_ref) -> float:
    """The cost of a plan, the prices of exceeded bounds included."""
    prices = problem.prices_from(plan.x[0], np.asarray(x_ref, dtype=float), u_ref)
    prices = np.where(np.isfinite(prices), prices, 0.0)
    return float(plan.cost + (problem.excess(plan.x[1:]) @ prices).sum())


def ratios(example: Example, count: int, max_programs: int, seed: int = 0) -> list[tuple]:
    """Our cost by IPOPT's, start, set point and status, of each random start, the dearest first."""
    mpc = lpvmpc.Mpc(example.mpc.plant, **{**example.mpc.settings, "max_programs": max_programs})
    problem, converged, random = Problem.of(example), Converged(example), np.random.default_rng(seed)
    u_ref = references(example, example.starts[-1])[1]
    found = []
    for _ in range(count):
        x0, target = (random.uniform(-1, 1, problem.n) * one for one in RANGES[example.name])
        mpc.reset()
        plan = mpc.step(x0, target, u_ref=u_ref)
        converged.plan = None
        rows = by_sample(target, 0, problem.horizon + 1, mpc.t_s)
        converged.solve(x0, rows, by_sample(u_ref, 0, problem.horizon, mpc.t_s))
        ratio = plan_cost(problem, plan, target, u_ref) / converged.cost if plan.is_solved else np.inf
        found.append((ratio, x0, target, plan.status, plan.programs))
    return sorted(found, key=lambda one: -one[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("example", choices=RANGES)
    parser.add_argument("count", type=int, nargs="?", default=100)
    options = parser.parse_args()
    example = importlib.import_module(options.example).example()
    for max_programs in (8, 50):
        found = ratios(example, options.count, max_programs)
        all_ratios = np.array([one[0] for one in found])
        print(f"{options.example}, at most {max_programs} programs: {np.mean(all_ratios > 1.01):.0%} dearer by more than 1 %, "
              f"{np.mean(all_ratios < 0.99):.0%} cheaper; median {np.median(all_ratios):.5f}")  # fmt: skip
        for ratio, x0, target, status, programs in found[:3]:
            print(f"  {ratio:8.4f} x0 {x0.round(4).tolist()} x_ref {target.round(4).tolist()} {status} {programs}")


if __name__ == "__main__":
    main()
