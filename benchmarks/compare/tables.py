#!/usr/bin/env python3
"""The measurements as Markdown: all of them into RESULTS.md, a part in place of what stands between the two
"compare" comments of ../README.md.

    tables.py FOLDER --note TEXT
"""

import argparse
import pathlib
import statistics

import results

HERE = pathlib.Path(__file__).parent
# What the README has of all files: these shares of active bounds.
SHARES = (0.0, 0.2, 0.4, 0.8)
IN_README = ("lpvmpc", "lpvmpc, cold", "HPIPM, exact", "HPIPM, 1e-8", "DAQP", "PIQP multistage", "Clarabel",
             "OSQP")


def number(value):
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def cell(times, name):
    """Median and worst; what is not exact in brackets, what leaves problems unsolved with their number."""
    time = times.get(name)
    if time is None:
        return "–"
    text = f"{number(time.median)} / {number(time.worst)}"
    if time.failures:
        return f"({text}, {time.failures} unsolved)"
    return text if time.exact else f"({text})"


def table(files, names):
    head = ["problems", "active", *names, "ratio"]
    lines = ["| " + " | ".join(head) + " |", "| --- |" + " ---: |" * (len(head) - 1)]
    for (size, horizon, kind, _), (active, times) in files.items():
        ratios = rival_to_ours(times)
        ratio = number(ratios[0]) if ratios else "–"
        cells = [cell(times, name) for name in names]
        row = [f"{size}, N = {horizon}, {kind}", f"{active:.0f}", *cells, ratio]
        lines.append("| " + " | ".join(row) + " |")
    return "\n".join(lines)


def rival_to_ours(times, starts=("lpvmpc", "lpvmpc, cold")):
    """The shortest median of an exact rival divided by that of the faster of our starts, and the shortest worst
    time of one divided by that of the same start."""
    rivals = [time for name, time in times.items() if not name.startswith("lpvmpc") and time.exact]
    if not rivals:
        return None
    own = min((times[name] for name in starts), key=lambda time: time.median)
    return min(time.median for time in rivals) / own.median, min(time.worst for time in rivals) / own.worst


def verdict(files):
    """How often we are behind, and by how much."""
    return (f"In {_verdict(files, ('lpvmpc', 'lpvmpc, cold'))}\n\nOur cold starts alone, beside the faster of a rival's "
            f"cold and warm ones: in {_verdict(files, ('lpvmpc, cold',))}")


def _verdict(files, starts):
    ratios = [ratios for ratios in (rival_to_ours(times, starts) for _, times in files.values()) if ratios]
    medians, worst = zip(*ratios)
    behind = [1 / ratio for ratio in medians if ratio < 1]
    text = f"{len(ratios) - len(behind)} of {len(ratios)} sequences lpvmpc's median is the shortest"
    if behind:
        text += (f", in {len(behind)} that of an exact rival; there ours is {sorted(behind)[len(behind) // 2]:.2f} "
                 f"times as long in the middle, {max(behind):.2f} times at most")
    beyond = sum(ratio < 1 / 1.5 for ratio in worst)
    return text + (f". Its worst time is more than 1.5 times the shortest worst of an exact rival in {beyond}, "
                   f"{1 / min(worst):.2f} times at most.")


def warm_starts(files):
    """What a start from the answer before saves, over the sequences with active bounds."""
    both = [(times["lpvmpc"], times["lpvmpc, cold"], key) for key, (_, times) in files.items()
            if key[3] > 0 and {"lpvmpc", "lpvmpc, cold"} <= times.keys()]
    if not both:
        return ""
    medians = [warm.median / cold.median for warm, cold, _ in both]
    worst = [warm.worst / cold.worst for warm, cold, _ in both]
    slower = [(ratio, key) for ratio, (_, _, key) in zip(medians, both) if ratio > 1.02]
    text = (f"Warm divided by cold, geometric means over the {len(both)} sequences with active bounds: median "
            f"{statistics.geometric_mean(medians):.2f}, worst {statistics.geometric_mean(worst):.2f}. The median is "
            f"more than 2 % longer in {len(slower)}")
    if slower:
        most, (size, horizon, kind, share) = max(slower)
        text += f", {most:.2f} times at most ({size}, N = {horizon}, {kind}, share {share:g})"
    return text + f"; the worst time is {max(worst):.2f} times as long at most."


def riccati_table(lines):
    """Our solver without bounds beside the faster form of HPIPM's recursion."""
    sizes = {}
    for line in lines:
        times = sizes.setdefault((line["size"], line["horizon"]), {})
        name = "HPIPM Riccati" if line["contender"] == "HPIPM Riccati" else line["contender"]
        times[name] = min(times.get(name, float("inf")), float(line["median_us"]))
    names = list(dict.fromkeys(name for times in sizes.values() for name in times))
    rows = ["| problems | " + " | ".join(names) + " |", "| --- |" + " ---: |" * len(names)]
    order = sorted(sizes.items(), key=lambda item: (int(item[0][0].split("x")[0]), int(item[0][1])))
    for (size, horizon), times in order:
        cells = [number(times[name]) if name in times else "–" for name in names]
        rows.append(f"| {size}, N = {horizon} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("folder", type=pathlib.Path)
    arguments.add_argument("--note", default="", help="machine, versions and date")
    options = arguments.parse_args()
    files, riccati, overheads, residual = results.read(options.folder)
    present = [name for name in results.CONTENDERS if any(name in times for _, times in files.values())]
    calls = ", ".join(f"{name} {number(us)}" for name, us in overheads.items())
    about = "\n\n".join(filter(None, [
        options.note,
        f"A call that does next to nothing, part of each time [us]: {calls}. Largest residual of the "
        f"optimality conditions at our answers: {residual:.1e}.",
        verdict(files),
        warm_starts(files),
    ]))
    whole = "\n\n".join([
        "# Solvers on the problem files", "Written by `tables.py`; what is timed is said in README.md.",
        about, "Median / worst over a sequence [us]; in brackets what is not exact (first input off by more "
        "than 1e-6 of the largest). *ratio*: the fastest exact rival's median, divided by our faster "
        "one.", table(files, present), "Without bounds, the Riccati recursion alone, median [us]:",
        riccati_table(riccati)])
    (HERE / "RESULTS.md").write_text(whole + "\n")

    chosen = {key: value for key, value in files.items() if key[1] in (20, 100) and key[3] in SHARES}
    names = [name for name in IN_README if name in present]
    part = "\n\n".join([about, table(chosen, names), "Without bounds, the Riccati recursion alone, median [us]:",
                        riccati_table(riccati)])
    begin, end = "<!-- compare -->\n", "\n<!-- end of compare -->"
    readme = HERE.parent / "README.md"
    head, rest = readme.read_text().split(begin, 1)
    readme.write_text(head + begin + "\n" + part + "\n" + end + rest.split(end, 1)[1])


if __name__ == "__main__":
    main()
