"""Plants of the tests."""

import casadi as ca

import lpvmpc


def cart_pole_formulas():
    """x, u, p, f and the values of p: a rod on a cart, without friction."""
    x, u, p = ca.SX.sym("x", 4), ca.SX.sym("u"), ca.SX.sym("p", 3)
    cart, pole, half = ca.vertsplit(p)
    sine, cosine = ca.sin(x[1]), ca.cos(x[1])
    force = u + pole * half * x[3] ** 2 * sine
    d = 4 / 3 * (cart + pole) - pole * cosine**2
    f = ca.vertcat(
        x[2],
        x[3],
        (4 / 3 * force - pole * 9.81 * sine * cosine) / d,
        ((cart + pole) * 9.81 * sine - cosine * force) / (half * d),
    )
    return x, u, p, f, {"cart_mass": 1.0, "pole_mass": 0.3, "half_length": 0.5}


def cart_pole(bounds=None):
    x, u, p, f, values = cart_pole_formulas()
    return lpvmpc.Plant.from_casadi(
        x,
        u,
        f,
        p=p,
        y=ca.vertcat(x[0] + ca.sin(x[1]), ca.cos(x[1])),
        name="cart-pole",
        states=["position", "tilt", "speed", "rate"],
        inputs=["force"],
        outputs=["tip_position", "tip_height"],
        parameters=values,
        units={"position": "m", "tilt": "rad", "speed": "m/s", "rate": "rad/s", "force": "N"},
        bounds=bounds or {"force": (-15, 15)},
        equilibrium=([0, 0, 0, 0], [0]),
    )


def double_integrator():
    return lpvmpc.Plant.from_matrices(
        [[0, 1], [0, 0]], [[0], [1]], states=["position", "speed"], inputs=["force"]
    )


def hovering():
    """A mass that a thrust holds up, of which the parameter is the mass."""
    x, u, m = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("m")
    return lpvmpc.Plant.from_casadi(
        x, u, ca.vertcat(x[1], u / m - 9.81), p=m, parameters={"m": 1.0}, states=["height", "speed"], inputs=["thrust"],
        bounds={"thrust": (0, 20)}, equilibrium=([2, 0], [9.81]),
    )  # fmt: skip
