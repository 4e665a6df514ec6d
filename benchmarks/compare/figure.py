#!/usr/bin/env python3
"""Time against active bounds, a panel for each size and kind, as PNG:

    figure.py FOLDER HORIZON PNG
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.lines import Line2D

import results

# Colours that are told apart without red and green, each with a mark of its own.
STYLES = {
    "lpvmpc": ("#000000", "o", "-", "lpvmpc, warm start"),
    "lpvmpc, cold": ("#000000", "o", ":", "lpvmpc, cold start"),
    "HPIPM, exact": ("#D55E00", "s", "-", "HPIPM, exact"),
    "HPIPM, 1e-8": ("#D55E00", "s", ":", "HPIPM, tolerance 1e-8"),
    "PIQP multistage": ("#0072B2", "^", "-", "PIQP, multistage"),
    "DAQP": ("#009E73", "v", "-", "DAQP (without condensing)"),
    "quadprog": ("#CC79A7", "D", "-", "quadprog (without condensing)"),
    "OSQP": ("#7F7F7F", "P", "-", "OSQP"),
    "Clarabel": ("#E69F00", "X", "-", "Clarabel"),
}
KINDS = {"inputs": "input bounds", "states": "state bounds", "rows": "general rows", "soft": "input and soft state bounds",
         "motion": "points with limits"}


def draw(axes, points, name):
    colour, mark, line, _ = STYLES[name]
    active = [x for x, _ in points]
    medians = [time.median for _, time in points]
    # What is not exact has an empty mark.
    axes.plot(active, medians, line, color=colour, linewidth=1.1, zorder=3 if "lpvmpc" in name else 2)
    for x, time in points:
        axes.plot(x, time.median, mark, color=colour, markersize=4, markeredgewidth=0.9,
                  markerfacecolor=colour if time.exact else "white", zorder=4)


def main():
    folder, horizon, path = sys.argv[1], int(sys.argv[2]), sys.argv[3]
    files, *_ = results.read(folder)
    files = {key: value for key, value in files.items() if key[1] == horizon}
    sizes = list(dict.fromkeys(key[0] for key in files))
    plt.rcParams.update({"font.family": "serif", "font.size": 9, "axes.linewidth": 0.6, "mathtext.fontset": "dejavuserif"})
    figure, grid = plt.subplots(len(sizes), len(KINDS), figsize=(11.5, 2.3 * len(sizes) + 0.9), sharey="row",
                                squeeze=False)
    for row, size in zip(grid, sizes):
        for axes, (kind, title) in zip(row, KINDS.items()):
            for name in STYLES:
                found = [value for key, value in files.items() if (key[0], key[2]) == (size, kind)]
                points = [(active, times[name]) for active, times in found if name in times]
                if points:
                    draw(axes, sorted(points, key=lambda point: point[0]), name)
            axes.set_yscale("log")
            axes.grid(True, which="major", linewidth=0.4, color="0.85")
            axes.tick_params(which="both", direction="in", width=0.5)
            if size == sizes[0]:
                axes.set_title(title, fontsize=10)
            if size == sizes[-1]:
                axes.set_xlabel("active bounds")
        row[0].set_ylabel(f"{size.replace('x', ' × ')}\nmedian time [µs]")
    shown = [name for name in STYLES if any(name in times for _, times in files.values())]
    handles = [Line2D([], [], color=STYLES[name][0], marker=STYLES[name][1], linestyle=STYLES[name][2],
                      markersize=4, linewidth=1.1, label=STYLES[name][3]) for name in shown]
    handles.append(Line2D([], [], color="0.3", marker="o", linestyle="none", markersize=4,
                          markerfacecolor="white", label="empty mark: not exact"))
    figure.legend(handles=handles, loc="lower center", ncol=4, frameon=False)
    figure.suptitle(f"Time for a quadratic program, N = {horizon}, states × inputs", fontsize=11)
    figure.tight_layout(rect=(0, 0.75 / figure.get_figheight(), 1, 1))
    figure.savefig(path, dpi=130, pil_kwargs={"optimize": True})


if __name__ == "__main__":
    main()
