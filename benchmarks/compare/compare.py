#!/usr/bin/env python3
"""Times our solver and published ones, interleaved in this process, on problem files:

    compare.py --library LIBRARY --out CSV [--seconds S] FILE...

What is timed, and what not, is said in README.md.
"""

import argparse
import csv
import gc
import os
import time

# One thread for everybody, before numpy looks.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import scipy.sparse as sp

import contenders
import forms
import own
import problem_file

# More variables than these take a dense solver too long.
MOST_DENSE = 240
# A contender that takes longer for one sweep through a sequence is timed once [s].
SLOW = 0.3
MOST_SWEEPS = 20
COLUMNS = ("size", "horizon", "kind", "wanted", "active", "contender", "variant", "choices", "median_us",
           "worst_us", "u0_error", "our_residual", "failures")


class Entry:
    """A contender with its times: the shortest of each problem [ns]."""

    def __init__(self, name, variant, solver, problems):
        self.name, self.variant, self.solver = name, variant, solver
        self.shortest = np.full(problems, np.inf)
        self.inputs = [None] * problems
        self.slow = False

    def sweep(self):
        """Once through the sequence."""
        begin = time.perf_counter()
        for k in range(len(self.shortest)):
            arguments = self.solver.prepare(k)
            start = time.perf_counter_ns()
            self.solver.call(arguments)
            taken = time.perf_counter_ns() - start
            self.shortest[k] = min(self.shortest[k], taken)
            self.inputs[k] = self.solver.first_input()
        self.slow = time.perf_counter() - begin > SLOW

    def row(self, sequence, reference, residual, choices):
        """A line of the table of results."""
        largest = max(np.abs(reference).max(), 1e-300)
        answered = [(u0, wanted) for u0, wanted in zip(self.inputs, reference) if u0 is not None]
        error = max((np.abs(u0 - wanted).max() / largest for u0, wanted in answered), default=np.inf)
        us = self.shortest / 1e3
        return (sequence.size, sequence.horizon, sequence.kind, f"{sequence.wanted:g}",
                f"{sequence.active:.1f}", self.name, self.variant, choices, f"{np.median(us):.3f}",
                f"{us.max():.3f}", f"{error:.1e}", f"{residual:.1e}",
                len(self.inputs) - len(answered))


def enter(sequence, library):
    """All contenders for a sequence, and the shortest time of condensing [us]."""
    count = len(sequence.problems)
    entries = [Entry("lpvmpc", "warm" if warm else "cold", own.Own(library, sequence, warm), count)
               for warm in (False, True)]
    sparse = [forms.sparse(problem) for problem in sequence.problems]
    dense, condensing = None, None
    if len(sparse[0].q) - sequence.horizon * sequence.nx <= MOST_DENSE:
        dense, times = [], []
        for problem in sequence.problems:
            begin = time.perf_counter()
            dense.append(forms.condense(problem))
            times.append(1e6 * (time.perf_counter() - begin))
        condensing = min(times)
    for kind in contenders.ALL:
        data = dense if kind.form == "dense" else sparse
        if data is not None:
            entries.append(Entry(kind.name, kind.form, kind(data, sequence.nu), count))
    return entries, condensing


def reference_of(solver, count):
    """Our first inputs, and the largest residual of the optimality conditions at our answers."""
    inputs, residual = [], 0.0
    for k in range(count):
        solver.call(solver.prepare(k))
        inputs.append(solver.first_input())
        residual = max(residual, solver.residual(k))
    if any(u0 is None for u0 in inputs):
        raise RuntimeError("our solver leaves a problem unsolved")
    return np.array(inputs), residual


def race(sequence, library, seconds):
    """The lines of one file."""
    entries, condensing = enter(sequence, library)
    reference, residual = reference_of(entries[0].solver, len(sequence.problems))
    end = time.perf_counter() + seconds
    for turn in range(MOST_SWEEPS):
        for entry in entries:
            if turn == 0 or not entry.slow:
                entry.sweep()
        if turn >= 2 and time.perf_counter() > end:
            break
    note = "" if condensing is None else f"condensing {condensing:.0f} us"
    rows = [entry.row(sequence, reference, residual, note if entry.variant == "dense" else "")
            for entry in entries]
    for entry in entries[:2]:
        entry.solver.close()
    return rows


def say_overheads(library):
    """What a call takes that does next to nothing: ours has a function for it, the others get a problem
    with one variable."""
    nothing = library.c.lpvmpc_nothing
    one = forms.Dense(np.eye(1), np.ones(1), np.ones((1, 1)), -np.ones(1), np.ones(1), -np.ones(1),
                      np.ones(1))
    small = forms.Sparse(sp.csc_matrix(np.eye(2)), np.ones(2), sp.csc_matrix(np.ones((1, 2))), np.ones(1),
                         sp.csc_matrix(np.ones((1, 2))), -np.ones(1), np.ones(1), -np.ones(2), np.ones(2))

    def shortest(call, *arguments):
        times = []
        for _ in range(200):
            begin = time.perf_counter_ns()
            call(*arguments)
            times.append(time.perf_counter_ns() - begin)
        return min(times) / 1e3

    lines = [("lpvmpc", shortest(nothing))]
    for kind in contenders.ALL:
        solver = kind([one if kind.form == "dense" else small], 1)
        lines.append((kind.name, shortest(lambda: solver.call(solver.prepare(0)))))
    return lines


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--library", required=True)
    arguments.add_argument("--out", required=True)
    arguments.add_argument("--seconds", type=float, default=0.5, help="time for the sweeps of a file")
    arguments.add_argument("files", nargs="+")
    options = arguments.parse_args()
    library = own.Library(options.library)
    with open(options.out, "w", newline="") as file:
        out = csv.writer(file)
        out.writerow(COLUMNS)
        for name, overhead in say_overheads(library):
            out.writerow(("", "", "", "", "", name, "overhead", "", f"{overhead:.3f}", f"{overhead:.3f}", "",
                          "", ""))
        for path in options.files:
            sequence = problem_file.read(path)
            # A collection in the middle would be timed with whoever is at work.
            gc.collect()
            gc.disable()
            out.writerows(race(sequence, library, options.seconds))
            gc.enable()
            file.flush()
            print(path, flush=True)


if __name__ == "__main__":
    main()
