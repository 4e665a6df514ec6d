"""Plants as CasADi has them, in the format of lpvmpc-plant, and their values at random points.

Writes cart-pole.json, functions.json, values.json and rays.json here.
"""

import json
import random

import casadi as ca
from scipy.integrate import quad_vec

NAMES = {
    ca.OP_ADD: "add", ca.OP_SUB: "sub", ca.OP_MUL: "mul", ca.OP_DIV: "div", ca.OP_NEG: "neg",
    ca.OP_EXP: "exp", ca.OP_LOG: "log", ca.OP_POW: "pow", ca.OP_CONSTPOW: "pow",
    ca.OP_SQRT: "sqrt", ca.OP_SQ: "sq", ca.OP_INV: "inv", ca.OP_SIN: "sin", ca.OP_COS: "cos",
    ca.OP_TAN: "tan", ca.OP_ASIN: "asin", ca.OP_ACOS: "acos", ca.OP_ATAN: "atan",
    ca.OP_ATAN2: "atan2", ca.OP_SINH: "sinh", ca.OP_COSH: "cosh", ca.OP_TANH: "tanh",
    ca.OP_ASINH: "asinh", ca.OP_ACOSH: "acosh", ca.OP_ATANH: "atanh", ca.OP_EXPM1: "expm1",
    ca.OP_LOG1P: "log1p", ca.OP_FABS: "abs", ca.OP_SIGN: "sign", ca.OP_FLOOR: "floor",
    ca.OP_FMIN: "min", ca.OP_FMAX: "max", ca.OP_LT: "lt", ca.OP_LE: "le", ca.OP_EQ: "eq",
    ca.OP_IF_ELSE_ZERO: "if_else_zero",
}


class Program:
    """Operations, each once; sin(x)/x is one, which has a value at 0, too."""

    def __init__(self):
        self.operations = []
        self.known = {}

    def add(self, *operation):
        if operation[0] == "div" and self.operations[operation[1]] == ["sin", operation[2]]:
            operation = ("sinc", operation[2])
        if operation not in self.known:
            self.known[operation] = len(self.operations)
            self.operations.append(list(operation))
        return self.known[operation]

    def take(self, inputs, outputs):
        """The results of the SX expressions `outputs`, of inputs [(leaf name, SX vector), ...]."""
        f = ca.Function("f", [vector for _, vector in inputs], outputs, {"cse": True})
        results = [[None] * f.nnz_out(i) for i in range(f.n_out())]
        work = {}
        for k in range(f.n_instructions()):
            op = f.instruction_id(k)
            arguments, places = f.instruction_input(k), f.instruction_output(k)
            if op == ca.OP_INPUT:
                work[places[0]] = self.add(inputs[arguments[0]][0], arguments[1])
            elif op == ca.OP_CONST:
                work[places[0]] = self.add("constant", f.instruction_constant(k))
            elif op == ca.OP_OUTPUT:
                results[places[0]][places[1]] = work[arguments[0]]
            else:
                of = [work[a] for a in arguments]
                if op == ca.OP_TWICE:
                    result = self.add("add", of[0], of[0])
                elif op == ca.OP_NOT:
                    result = self.add("eq", of[0], self.add("constant", 0.0))
                elif op == ca.OP_NE:
                    equal = self.add("eq", *of)
                    result = self.add("eq", equal, self.add("constant", 0.0))
                elif op == ca.OP_AND:
                    result = self.add("mul", *of)
                elif op == ca.OP_OR:
                    result = self.add("max", *of)
                elif op == ca.OP_HYPOT:
                    result = self.add("sqrt", self.add("add", *[self.add("sq", a) for a in of]))
                else:
                    result = self.add(NAMES[op], *of)
                work[places[0]] = result
        return results


def signals(names):
    return [{"name": name, "unit": unit} for name, unit in names]


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
    program = Program()
    motion = [("state", x), ("input", u), ("parameter", p)]
    f_results, tip_results = program.take(motion, [f, tip])
    a_results, b_results = program.take([("scheduling", s), ("parameter", p)], [dense(a), b])
    plant = {
        "schema": 1,
        "name": "cart-pole",
        "states": signals([("position", "m"), ("tilt", "rad"), ("speed", "m/s"), ("rate", "rad/s")]),
        "inputs": [{"name": "force", "unit": "N", "lower": -15, "upper": 15}],
        "parameters": [
            {"name": name, "unit": unit, "value": value}
            for name, unit, value in [
                ("cart_mass", "kg", 1.0), ("pole_mass", "kg", 0.3), ("half_length", "m", 0.5),
                ("friction", "N s/m", 0.1), ("gravity", "m/s^2", 9.81),
            ]
        ],
        "outputs": signals([("tip_position", "m"), ("tip_height", "m")]),
        "operations": program.operations,
        "derivative": f_results,
        "output": tip_results,
        "embedding": {
            "scheduling": [program.add("state", 1), program.add("state", 3)],
            "a": [a_results[4 * i:4 * i + 4] for i in range(4)],
            "b": [[i] for i in b_results],
        },
        "equilibrium": {"x": [0, 0, 0, 0], "u": [0]},
    }
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
    program = Program()
    (results,) = program.take([("state", x), ("input", u), ("parameter", p)], [f])
    plant = {
        "schema": 1,
        "name": "functions",
        "states": signals([("a", ""), ("b", ""), ("c", "")]),
        "inputs": signals([("v", ""), ("w", "")]),
        "parameters": [{"name": "p", "unit": "", "value": 0.7}],
        "operations": program.operations,
        "derivative": results,
    }
    return plant, ca.Function("f", [x, u, p], [f, ca.SX(0, 1)])


def main():
    rng = random.Random(17)
    values = {}
    for plant, f in [cart_pole(), functions()]:
        name = plant["name"]
        with open(f"{name}.json", "w") as file:
            json.dump(plant, file)
            file.write("\n")
        x, u, p = (ca.SX.sym(name, f.size1_in(i)) for i, name in enumerate("xup"))
        rate, y = f(x, u, p)
        table = ca.Function("table", [x, u, p], [
            rate, y, dense(ca.jacobian(rate, x)), dense(ca.jacobian(rate, u)),
        ])
        values[name] = []
        for _ in range(40):
            point = [[rng.uniform(-3, 3) for _ in range(f.size1_in(i))] for i in range(2)]
            point.append([parameter["value"] for parameter in plant["parameters"]])
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
    p = [parameter["value"] for parameter in plant["parameters"]]
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
