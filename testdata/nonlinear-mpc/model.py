"""The ballbot in one plane, the transcription that both controllers share, and the cost of a loop.

State: phi [rad], theta [rad], phi_dot [rad/s], theta_dot [rad/s]; input: torque [N m].
"""
import math

import casadi as ca
import numpy as np
from scipy.linalg import solve_discrete_are

B1, B2, B3, B4 = 0.002483, 0.059325, 0.143093, -0.07436
LENGTH, R_BALL, R_WHEEL, GRAVITY = 0.2978, 0.12, 0.05, 9.81

Q_DIAGONAL = np.array([200.0, 1.0, 0.1, 0.1])
R = 1000.0
TORQUE_BOUND = 1.5
# Bounds of theta, phi_dot and theta_dot; phi has none.
STATE_BOUND = np.array([math.pi / 3, 10 * math.pi, 2 * math.pi])
# Price of a state bound per unit of excess, over P_jj times the width of the bound.
PRICE_FACTOR = 20.0
# The same far away, over the root of P_jj times the cost of a plan that stands still.
PRICE_OF_WAY = 4.0

# Modulus of the fastest eigenvalue at the upright equilibrium, and how much of it one step may take.
FASTEST_POLE = 51.8017
STEP_TIMES_POLE = 0.7
# Integration steps of the plant per millisecond.
PLANT_STEPS_PER_MS = 4


def derivative(x, u):
    """Time derivative of the state, for CasADi symbols."""
    c, s = ca.cos(x[1]), ca.sin(x[1])
    k = B2 - LENGTH * R_BALL * c
    determinant = B1 * B3 - k * k
    on_ball = LENGTH * R_BALL * s * x[3] ** 2 - B4 * x[2] + R_BALL / R_WHEEL * u
    on_body = LENGTH * GRAVITY * s - R_BALL / R_WHEEL * u
    return ca.vertcat(
        x[2],
        x[3],
        (B3 * on_ball + k * on_body) / determinant,
        (k * on_ball + B1 * on_body) / determinant,
    )


def runge_kutta(x, u, h):
    """One classical Runge-Kutta step of h seconds with the input held."""
    k1 = derivative(x, u)
    k2 = derivative(x + h / 2 * k1, u)
    k3 = derivative(x + h / 2 * k2, u)
    k4 = derivative(x + h * k3, u)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def substeps(t_s):
    """Runge-Kutta steps per sample of t_s seconds."""
    return math.ceil(t_s * FASTEST_POLE / STEP_TIMES_POLE)


def sampled(t_s):
    """The predictor: the state one sample of t_s seconds later."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")
    y, count = x, substeps(t_s)
    for _ in range(count):
        y = runge_kutta(y, u, t_s / count)
    return ca.Function("sampled", [x, u], [y], {"cse": True})


def plant():
    """The plant over one millisecond; its error is far below that of the predictor."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")
    y = x
    for _ in range(PLANT_STEPS_PER_MS):
        y = runge_kutta(y, u, 1e-3 / PLANT_STEPS_PER_MS)
    return ca.Function("plant", [x, u], [y], {"cse": True})


class Design:
    """What belongs to a sampling time and bounds: predictor, linear model, terminal cost, regulator, prices."""

    def __init__(self, t_s, state_bound=STATE_BOUND, torque_bound=TORQUE_BOUND):
        self.t_s, self.state_bound, self.torque_bound = t_s, np.array(state_bound), torque_bound
        self.predict = sampled(t_s)
        x, u = ca.SX.sym("x", 4), ca.SX.sym("u")
        y = self.predict(x, u)
        jacobians = ca.Function("jacobians", [x, u], [ca.jacobian(y, x), ca.jacobian(y, u)])
        a, b = jacobians(np.zeros(4), 0.0)
        self.a, self.b = a.full(), b.full()
        self.p = solve_discrete_are(self.a, self.b, np.diag(Q_DIAGONAL), np.array([[R]]))
        # The regulator is u = -k (x - x_ref), its curvature r + b'pb.
        self.curvature = (R + self.b.T @ self.p @ self.b).item()
        self.k = (self.b.T @ self.p @ self.a / self.curvature).ravel()
        self.price = PRICE_FACTOR * np.diag(self.p)[1:] * 2 * self.state_bound

    def raised_price(self, x, goal, horizon):
        """The prices from a state on, where they rise with the way."""
        e = x - goal
        still = e @ self.p @ e + horizon * Q_DIAGONAL @ e**2
        return np.maximum(self.price, PRICE_OF_WAY * np.sqrt(np.diag(self.p)[1:] * still))

    def objective(self, x, u, goal, price):
        """Cost of a trajectory (x: 4 by N+1, u: N), the price of the state bounds included."""
        e = x - goal[:, None]
        excess = np.maximum(0.0, np.abs(x[1:, 1:]) - self.state_bound[:, None])
        return (
            Q_DIAGONAL @ (e[:, :-1] ** 2).sum(axis=1)
            + R * u @ u
            + e[:, -1] @ self.p @ e[:, -1]
            + price @ excess.sum(axis=1)
        )


def stage_cost(x, u, goal):
    e = x - goal
    return Q_DIAGONAL @ (e * e) + R * u * u
