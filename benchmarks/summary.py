#!/usr/bin/env python3
"""Criterion's samples as Markdown: microseconds per quadratic program in the shortest sample, and
in brackets the ratio to lpvmpc. What else a machine does only adds to a time, so the shortest of
the samples is the steadiest figure; each is long enough to average over many solves.

    summary.py [--baseline NAME] [--update README.md]

Reads $CARGO_TARGET_DIR/criterion, or target/criterion beside this file. Prints the tables, or
replaces what stands between the two "summary" comments of the given file.
"""

import argparse
import datetime
import json
import os
import pathlib
import re
import subprocess

HERE = pathlib.Path(__file__).parent
OURS = "lpvmpc"


def measurements(directory, baseline):
    """{family: {sequence: {contender: microseconds}}}, in the order in which they were taken."""
    found = directory.glob(f"*/*/{baseline}/sample.json")
    families = {}
    for path in sorted(found, key=lambda path: path.stat().st_mtime_ns):
        about = json.loads(path.with_name("benchmark.json").read_text())
        samples = json.loads(path.read_text())
        pairs = zip(samples["times"], samples["iters"])
        nanoseconds = min(time / iterations for time, iterations in pairs)
        family, sequence = about["group_id"].split("/", 1)
        times = families.setdefault(family, {}).setdefault(sequence, {})
        times[about["function_id"]] = nanoseconds / 1e3 / about["throughput"]["Elements"]
    return families


def table(sequences):
    """One table; the longer side goes down."""
    contenders = list(dict.fromkeys(name for times in sequences.values() for name in times))

    def cell(sequence, contender):
        times = sequences[sequence]
        if contender not in times:
            return "–"
        time = times[contender]
        ratio = f" ({time / times[OURS]:.3g})" if OURS in times and contender != OURS else ""
        return f"{time:.3g}{ratio}" if time < 1000 else f"{time:.0f}{ratio}"

    if len(sequences) > len(contenders):
        rows, columns, at = list(sequences), contenders, cell
    else:
        rows, columns, at = contenders, list(sequences), lambda row, column: cell(column, row)
    lines = [["us per problem", *columns], ["---", *["---:"] * len(columns)]]
    lines += [[row, *(at(row, column) for column in columns)] for row in rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def machine():
    """Processor, compiler and day, as far as they can be told."""
    try:
        cpuinfo = pathlib.Path("/proc/cpuinfo").read_text()
        model = re.search(r"model name\s*: (.*)", cpuinfo).group(1)
    except (OSError, AttributeError):
        model = "unknown processor"
    rustc = subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True)
    version = " ".join(rustc.stdout.split()[:2])
    return f"{model}, {version}, {datetime.date.today().isoformat()}."


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--baseline", default="new", help="name given to --save-baseline")
    arguments.add_argument("--update", type=pathlib.Path, help="file to write the tables into")
    options = arguments.parse_args()

    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", HERE / "target"))
    families = measurements(target / "criterion", options.baseline)
    if not families:
        raise SystemExit(f"no measurements in {target / 'criterion'}: run `cargo bench` first")
    parts = [machine()]
    parts += [f"**{name}**\n\n{table(sequences)}" for name, sequences in families.items()]
    summary = "\n\n".join(parts)

    if options.update is None:
        print(summary)
        return
    begin, end = "<!-- summary -->\n", "\n<!-- end of summary -->"
    text = options.update.read_text()
    if begin not in text or end not in text:
        raise SystemExit(f"{options.update} has no place between {begin!r} and {end!r}")
    head, rest = text.split(begin, 1)
    tail = rest.split(end, 1)[1]
    options.update.write_text(head + begin + "\n" + summary + "\n" + end + tail)


if __name__ == "__main__":
    main()
