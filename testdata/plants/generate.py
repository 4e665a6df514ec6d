"""Plants as CasADi has them, in the format of lpvmpc-plant, and CasADi's values of them at random points.

Writes cart-pole.json, functions.json, values.json and rays.json here.
"""

import json
import random

import casadi as ca
import lpvmpc
from scipy.integrate import quad_vec


def dense(expression):
    """Row by row, structural zeros too."""
    return ca.densify(ca.vec(expression.T))


def cart_pole():
    x, u, p, s = ca.SX.sym("x", 4), ca.SX.sym("u"), ca.SX.sym("p", 5), ca.SX.sym("s", 2)
    cart, pole, half, friction, gravity = ca.vertsplit(p)

    def matrices(theta, rate):
        sinc = ca.sin(theta) / theta
        d = 4 / 3 * (cart + pole) - pole * ca.cos(theta) ** 2
        b = [4 / 3 / d, -ca.cos(theta) / (half * d)]
        swing = pole * half * rate * ca.sin(theta)
        pull = gravity * sinc / d
        a = ca.blockcat([
            [0, 0, 1, 0],
            [0, 0, 0, 1],
            [0, -pole * ca.cos(theta) * pull, -friction * b[0], swing * b[0]],
            [0, (cart + pole) / half * pull, -friction * b[1], swing * b[1]],
        ])
        return a, ca.vertcat(0, 0, *b)

    total = cart + pole
    force = u - friction * x[2] + pole * half * x[3] ** 2 * ca.sin(x[1])
    d = 4 / 3 * total - pole * ca.cos(x[1]) ** 2
    f = ca.vertcat(
        x[2],
        x[3],
        (4 / 3 * force - pole * gravity * ca.sin(x[1]) * ca.cos(x[1])) / d,
        (total * gravity * ca.sin(x[1]) - ca.cos(x[1]) * force) / (half * d),
    )
    tip = ca.vertcat(x[0] + 2 * half * ca.sin(x[1]), 2 * half * ca.cos(x[1]))
    a, b = matrices(s[0], s[1])
    plant = lpvmpc.Plant.from_casadi(
        x, u, f, p=p, y=tip, name="cart-pole",
        states=["position", "tilt", "speed", "rate"], inputs=["force"],
        outputs=["tip_position", "tip_height"],
        parameters={"cart_mass": 1.0, "pole_mass": 0.3, "half_length": 0.5, "friction": 0.1,
                    "gravity": 9.81},
        units={"position": "m", "tilt": "rad", "speed": "m/s", "rate": "rad/s", "force": "N",
               "cart_mass": "kg", "pole_mass": "kg", "half_length": "m", "friction": "N s/m",
               "gravity": "m/s^2", "tip_position": "m", "tip_height": "m"},
        bounds={"force": (-15, 15)}, equilibrium=([0, 0, 0, 0], [0]),
        embedding=lpvmpc.Embedding(s=s, sigma=ca.vertcat(x[1], x[3]), a=a, b=b),
    )
    return plant, ca.Function("f", [x, u, p], [f, tip])


def functions():
    """Every operation, each where it is smooth."""
    x, u, p = ca.SX.sym("x", 3), ca.SX.sym("u", 2), ca.SX.sym("p", 1)
    a, b, c = ca.vertsplit(x)
    v, w = ca.vertsplit(u)
    small = ca.tanh(a) / 2
    f = ca.vertcat(
        ca.asin(small) + ca.acos(small * v / 3) - ca.atan(b * w) * ca.sinh(a / 2) + ca.cosh(b / 2)
        + ca.asinh(a * b) - ca.acosh(2 + c**2) + ca.atanh(small) * ca.tan(small) + ca.exp(a / 3),
        ca.log(2 + c**2) + (1 + a**2) ** b + (2 + b**2) ** -1.3 + c**3 * a**-2 + ca.sqrt(1 + v**2)
        + ca.atan2(b, c) + ca.expm1(a / 9) - ca.log1p(b**2) + ca.hypot(v, w) + 1 / (3 + w**2),
        ca.fabs(a) + ca.sign(b) * c - ca.fmin(a, b) * ca.fmax(v, c) + ca.floor(3 * w) * a
        + ca.if_else(a < b, ca.sin(v), c**2) + ca.if_else(ca.logic_and(a <= c, v != w), p * v, b)
        + ca.if_else(ca.logic_or(ca.logic_not(a < v), b <= w), 1, -c),
    )
    plant = lpvmpc.Plant.from_casadi(
        x, u, f, p=p, name="functions", states=["a", "b", "c"], inputs=["v", "w"],
        parameters={"p": 0.7},
    )
    return plant, ca.Function("f", [x, u, p], [f, ca.SX(0, 1)])


def main():
    rng = random.Random(17)
    values = {}
    for plant, f in [cart_pole(), functions()]:
        name = plant.name
        plant.save(f"{name}.json")
        x, u, p = (ca.SX.sym(name, f.size1_in(i)) for i, name in enumerate("xup"))
        rate, y = f(x, u, p)
        table = ca.Function("table", [x, u, p], [
            rate, y, dense(ca.jacobian(rate, x)), dense(ca.jacobian(rate, u)),
        ])
        values[name] = []
        for _ in range(40):
            point = [[rng.uniform(-3, 3) for _ in range(f.size1_in(i))] for i in range(2)]
            point.append(list(plant.parameters.values()))
            found = [list(map(float, ca.DM(v).full().ravel())) for v in table(*point)]
            values[name].append(dict(zip(["x", "u", "f", "y", "a", "b"], point[:2] + found)))
    with open("values.json", "w") as file:
        lines = (f'"{name}": [\n' + ",\n".join(map(json.dumps, points)) + "\n]"
                 for name, points in values.items())
        file.write("{" + ",\n".join(lines) + "}\n")


    with open("rays.json", "w") as file:
        json.dump(rays(rng), file)
        file.write("\n")


def rays(rng):
    """Mean derivatives of the cart-pole from (x_r, u_r) to (x, u), by adaptive quadrature."""
    plant, f = cart_pole()
    p = list(plant.parameters.values())
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")
    rate, _ = f(x, u, p)
    slopes = ca.Function("slopes", [x, u], [ca.vertcat(
        dense(ca.jacobian(rate, x)), dense(ca.jacobian(rate, u)))])
    found = []
    for at in [[0, 0, 0, 0, 0], [0.3, -0.2, 0.1, 0.4, 2.0]]:
        for _ in range(10):
            to = [rng.uniform(-1, 1), rng.uniform(-1.2, 1.2), rng.uniform(-2, 2),
                  rng.uniform(-3, 3), rng.uniform(-15, 15)]

            def along(part):
                z = [a + part * (b - a) for a, b in zip(at, to)]
                return slopes(z[:4], z[4]).full().ravel()

            mean, error = quad_vec(along, 0, 1, epsabs=1e-14, epsrel=1e-14)
            assert error < 1e-11
            found.append({"from": at, "to": to, "a": list(mean[:16]), "b": list(mean[16:])})
    return found


if __name__ == "__main__":
    main()
