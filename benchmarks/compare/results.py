"""What the two programs have measured, one entry for each problem file and contender."""

import csv
import dataclasses
import pathlib

EXACT = 1e-6
# The contenders of tables and figures, in this order. HPIPM is there twice: with its tolerance as given,
# and with the loosest tolerance and the faster mode whose answers are exact.
CONTENDERS = ("lpvmpc", "lpvmpc, cold", "lpvmpc native", "lpvmpc native, cold", "HPIPM, exact", "HPIPM, 1e-8",
              "DAQP", "DAQP warm", "quadprog", "PIQP dense", "PIQP multistage", "Clarabel", "OSQP")


@dataclasses.dataclass
class Time:
    """Times in us, median and worst over a sequence, and the largest error of u_0."""

    median: float
    worst: float
    error: float
    failures: int
    choices: str

    @property
    def exact(self):
        return self.error <= EXACT and self.failures == 0


def _names(line):
    """The contenders for which a line of measurements counts."""
    name, variant = line["contender"], line["variant"]
    if name.startswith("lpvmpc"):
        return [] if variant == "no bounds" else [name + ("" if variant == "warm" else ", cold")]
    if name.startswith("HPIPM SPEED_ABS") or name.startswith("HPIPM BALANCE"):
        given = "tolerance 1e-08" in line["choices"]
        exact = float(line["u0_error"]) <= EXACT and line["failures"] == "0"
        return ["HPIPM, exact"] * exact + ["HPIPM, 1e-8"] * given
    return [name] if name in CONTENDERS else []


def read(folder):
    """{(size, horizon, kind, wanted share): (active bounds, {contender: Time})}, lines of the Riccati
    recursion, the calls that do nothing {contender: us}, and the largest residual of our answers.

    Of several lines for the same contender the fastest median counts: the choices of HPIPM, and our solver,
    which runs in both programs, in that beside HPIPM.
    """
    files, riccati, overheads, residual, first = {}, [], {}, 0.0, {}
    for path in sorted(pathlib.Path(folder).glob("*.csv")):
        with path.open() as lines:
            for line in csv.DictReader(lines):
                if line["variant"] == "overhead":
                    us = overheads.get(line["contender"], float("inf"))
                    overheads[line["contender"]] = min(us, float(line["median_us"]))
                    continue
                residual = max(residual, float(line["our_residual"]))
                if line["variant"] == "no bounds" or line["contender"] == "HPIPM Riccati":
                    riccati.append(line)
                    continue
                key = (line["size"], int(line["horizon"]), line["kind"], float(line["wanted"]))
                times = files.setdefault(key, (float(line["active"]), {}))[1]
                new = Time(float(line["median_us"]), float(line["worst_us"]), float(line["u0_error"]),
                           int(line["failures"]),
                           f"{line['contender']} {line['variant']} {line['choices']}")
                for name in _names(line):
                    if name.startswith("lpvmpc") and first.setdefault((key, name), path) != path:
                        continue
                    if name not in times or _better(new, times[name]):
                        times[name] = new
    order = lambda item: (int(item[0][0].split("x")[0]), *item[0][1:])
    return dict(sorted(files.items(), key=order)), riccati, overheads, residual


def _better(new, known):
    """A solved sequence before one that is not, then the shorter time."""
    return (new.failures, new.median) < (known.failures, known.median)
