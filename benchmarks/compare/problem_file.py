"""Problem files (../problems/README.md) as numpy arrays."""

import dataclasses
import pathlib

import numpy as np


@dataclasses.dataclass
class Stage:
    """A stage, or the end of the horizon: there B, R, S and everything of inputs have no columns."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    q: np.ndarray
    r: np.ndarray
    s: np.ndarray
    linear_x: np.ndarray
    linear_u: np.ndarray
    x_lower: np.ndarray
    x_upper: np.ndarray
    x_linear: np.ndarray
    x_quadratic: np.ndarray
    u_lower: np.ndarray
    u_upper: np.ndarray
    rows_x: np.ndarray
    rows_u: np.ndarray
    rows_lower: np.ndarray
    rows_upper: np.ndarray
    rows_linear: np.ndarray
    rows_quadratic: np.ndarray


@dataclasses.dataclass
class Problem:
    """From `x0` through the stages to the end, which is the last of them."""

    x0: np.ndarray
    stages: list[Stage]


@dataclasses.dataclass
class Sequence:
    """The problems of a file: their numbers as they stand there, and as arrays."""

    nx: int
    nu: int
    horizon: int
    rows: int
    common: int
    kind: str
    wanted: float
    share: float
    numbers: np.ndarray
    problems: list[Problem]

    @property
    def size(self):
        return f"{self.nx}x{self.nu}"

    @property
    def active(self):
        """Active bounds, on average over the sequence."""
        return self.share * self.horizon * self.nu


def read(path):
    """Reads a whole file."""
    with pathlib.Path(path).open("rb") as file:
        words = file.readline().decode().split()
        numbers = np.frombuffer(file.read(), "<f8")
    if words[:2] != ["lpvmpc-problems", "1"]:
        raise ValueError(f"{path} is no problem file")
    header = dict(zip(words[2::2], words[3::2]))
    nx, nu, horizon, rows, common = (int(header[key]) for key in ("nx", "nu", "horizon", "rows", "common"))
    numbers = numbers.reshape(int(header["problems"]), -1)
    problems = [_problem(row, nx, nu, horizon, rows) for row in numbers]
    return Sequence(nx, nu, horizon, rows, common, header["kind"], float(header["wanted"]),
                    float(header["share"]), numbers, problems)


def _problem(numbers, nx, nu, horizon, rows):
    place = 0

    def take(*shape):
        nonlocal place
        count = int(np.prod(shape))
        part = numbers[place : place + count].reshape(shape, order="F")
        place += count
        return part

    x0 = take(nx)
    stages = []
    for _ in range(horizon):
        dynamics = [take(nx, nx), take(nx, nu), take(nx)]
        weights = [take(nx, nx), take(nu, nu), take(nu, nx), take(nx), take(nu)]
        bounds = [take(nx) for _ in range(4)] + [take(nu), take(nu)]
        general = [take(rows, nx), take(rows, nu)] + [take(rows) for _ in range(4)]
        stages.append(Stage(*dynamics, *weights, *bounds, *general))
    p, linear = take(nx, nx), take(nx)
    bounds = [take(nx) for _ in range(4)]
    rows_x, general = take(rows, nx), [take(rows) for _ in range(4)]
    none = np.zeros
    stages.append(Stage(none((0, nx)), none((0, 0)), none(0), p, none((0, 0)), none((0, nx)), linear, none(0),
                        *bounds, none(0), none(0), rows_x, none((rows, 0)), *general))
    return Problem(x0, stages)
