"""Figures of the examples."""

from __future__ import annotations

from typing import Any

import lpvmpc
from problem import Example


def figure(example: Example, run: lpvmpc.Run) -> Any:
    """The signals of an example over time; beside its path, if it has one."""
    from matplotlib import pyplot

    height = 0.9 + 1.3 * len(example.show)
    if example.path is None:
        made = pyplot.figure(figsize=(6.4, height), layout="constrained")
        run.plot(example.show, figure=made)
    else:
        whole = pyplot.figure(figsize=(10.0, height), layout="constrained")
        left, right = whole.subfigures(1, 2, width_ratios=[1.0, 1.1])
        axes = left.subplots()
        example.path(axes, run)
        run.plot(example.show, figure=right)
        made = whole
    return made
