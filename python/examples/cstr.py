"""The continuous stirred tank reactor of do-mpc's examples.

Model and numbers: K.-U. Klatt, S. Engell, Gain-scheduling trajectory control of a continuous stirred tank reactor,
Computers and Chemical Engineering 22(4-5), 1998, as in do-mpc's documentation (Continuous stirred tank reactor).
There the cost is of c_b alone; here of the whole steady state with that c_b.
"""

import casadi as ca
import compare
import lpvmpc
import numpy as np
from problem import Example, Start

RATES, ENERGIES = (1.287e12, 1.287e12, 9.043e9), (9758.3, 9758.3, 8560.0)  # 1/h, K
HEATS = (4.2, -11.0, -41.85)  # kJ/mol, of A -> B, B -> C, 2 A -> D
DENSITY, CAPACITY, COOLANT_CAPACITY, COOLANT = 0.9342, 3.01, 2.0, 5.0  # kg/l, kJ/(kg K), kJ/(kg K), kg
AREA, VOLUME, TRANSFER, INLET, FEED = 0.215, 10.01, 4032.0, 130.0, 5.1  # m^2, l, kJ/(h m^2 K), C, mol/l
HOUR = 3600.0  # s


def speeds(temperature, exp):
    """Of the three reactions, at a temperature in degrees Celsius."""
    return [k * exp(-e / (temperature + 273.15)) for k, e in zip(RATES, ENERGIES)]


def steady(c_b: float, temperature: float) -> tuple[np.ndarray, np.ndarray]:
    """The steady state with this concentration and temperature: by hand from the equations."""
    k1, k2, k3 = speeds(temperature, np.exp)
    # Flow (k1 c_a - k2 c_b) / c_b put into the balance of A: a quadratic equation.
    c_a = min(np.roots([-k1 / c_b - k3, k1 * FEED / c_b + k2 - k1, -k2 * FEED]).real)
    flow = (k1 * c_a - k2 * c_b) / c_b
    heat = k1 * c_a * HEATS[0] + k2 * c_b * HEATS[1] + k3 * c_a**2 * HEATS[2]
    cooling = heat / (DENSITY * CAPACITY) - flow * (INLET - temperature)
    jacket = temperature + cooling * DENSITY * CAPACITY * VOLUME / (TRANSFER * AREA)
    power = -TRANSFER * AREA * (temperature - jacket)
    return np.array([c_a, c_b, temperature, jacket]), np.array([flow, power / 1000])


def example() -> Example:
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)  # c_a, c_b, temperatures; flow 1/h, heat MJ/h
    (c_a, c_b, inside, jacket), (flow, power) = ca.vertsplit(x), ca.vertsplit(u)
    k1, k2, k3 = speeds(inside, ca.exp)
    heat = k1 * c_a * HEATS[0] + k2 * c_b * HEATS[1] + k3 * c_a**2 * HEATS[2]
    through = TRANSFER * AREA * (jacket - inside)
    xdot = ca.vertcat(
        flow * (FEED - c_a) - k1 * c_a - k3 * c_a**2,
        -flow * c_b + k1 * c_a - k2 * c_b,
        -heat / (DENSITY * CAPACITY) + flow * (INLET - inside) + through / (DENSITY * CAPACITY * VOLUME),
        (1000 * power - through) / (COOLANT * COOLANT_CAPACITY),
    ) / HOUR  # fmt: skip
    target = steady(0.6, 134.0)
    plant = lpvmpc.Plant.from_casadi(
        x, u, xdot, name="reactor",
        states=["c_a", "c_b", "inside", "jacket"], inputs=["flow", "power"],
        units={"c_a": "mol/l", "c_b": "mol/l", "inside": "C", "jacket": "C", "flow": "1/h", "power": "MJ/h"},
        bounds={"c_a": (0.1, 2), "c_b": (0.1, 2), "inside": (50, 140), "jacket": (50, 140),
                "flow": (5, 100), "power": (-8.5, 0)},
        equilibrium=target,
    )  # fmt: skip
    q, r = [1, 100, 0.001, 0.0001], [1e-4, 1e-3]
    mpc = lpvmpc.Mpc(plant, t_s=18, horizon=40, q=q, r=r)
    x0 = [0.8, 0.5, 134.14, 130.0]
    there = {c_b: steady(c_b, temperature) for c_b, temperature in ((0.6, 134), (0.8, 134), (0.7, 139))}
    starts = [
        Start("c_b to 0.6", x0, 600, *there[0.6]),
        Start("c_b to 0.8", x0, 600, *there[0.8]),
        Start("c_b to 0.7 at 139 C", x0, 600, *there[0.7]),
        Start("cold", [0.8, 0.3, 90, 90], 1800, *there[0.6]),
        Start("too hot", [1.5, 0.5, 145, 120], 1800, *there[0.6]),
        Start("rich", [1.9, 1.2, 110, 135], 1800, *there[0.8]),
    ]
    return Example(
        "cstr", "Stirred tank reactor (do-mpc's example)", x, u, xdot, mpc, starts,
        show=["c_b", "inside", "jacket", "flow", "power"],
    )  # fmt: skip


if __name__ == "__main__":
    compare.main(example(), __doc__)
