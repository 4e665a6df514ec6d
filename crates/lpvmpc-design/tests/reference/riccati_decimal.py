#!/usr/bin/env python3
"""Reference values for tests/it/lqr.rs: the ballbot's regulators in 60-digit decimal arithmetic.

Newton's iteration on the Riccati equation (Kleinman 1968 in continuous, Hewer 1971 in discrete
time) from a stabilising gain; each step solves its linear matrix equation entry by entry with
Gaussian elimination. It shares neither method nor arithmetic with the code under test.
Run: python3 riccati_decimal.py
"""

from decimal import Decimal as D, getcontext

getcontext().prec = 60
N = range(4)
ZERO, ONE = D(0), D(1)
Q = [D(200), ONE, D("0.1"), D("0.1")]
R = D(1000)


def solve(m, y):
    """m x = y by Gauss-Jordan elimination with row pivoting."""
    n = len(m)
    m = [row[:] + [y[i]] for i, row in enumerate(m)]
    for c in range(n):
        pivot = max(range(c, n), key=lambda r: abs(m[r][c]))
        m[c], m[pivot] = m[pivot], m[c]
        for r in range(n):
            if r != c:
                f = m[r][c] / m[c][c]
                m[r] = [x - f * z for x, z in zip(m[r], m[c])]
    return [m[i][n] / m[i][i] for i in range(n)]


def times(x, y):
    return [[sum(x[i][k] * y[k][j] for k in N) for j in N] for i in N]


def newton(a, b, k, discrete):
    """K and diag P of the regulator, from the stabilising gain k."""
    for _ in range(12):
        loop = [[a[i][j] - b[i] * k[j] for j in N] for i in N]
        m = [[ZERO] * 16 for _ in range(16)]
        y = [ZERO] * 16
        for i in N:
            for j in N:
                row = m[4 * i + j]
                y[4 * i + j] = -(k[i] * R * k[j] + (Q[i] if i == j else ZERO))
                for s in N:
                    if discrete:
                        for t in N:
                            row[4 * s + t] += loop[s][i] * loop[t][j]
                    else:
                        row[4 * s + j] += loop[s][i]
                        row[4 * i + s] += loop[s][j]
                if discrete:
                    row[4 * i + j] -= ONE
        p = solve(m, y)
        bp = [sum(b[s] * p[4 * s + j] for s in N) for j in N]
        if discrete:
            weight = R + sum(bp[j] * b[j] for j in N)
            k = [sum(bp[s] * a[s][j] for s in N) / weight for j in N]
        else:
            k = [x / R for x in bp]
    return k, [p[5 * i] for i in N]


def model(entries):
    """A, B from p1 .. p6."""
    p1, p2, p3, p4, p5, p6 = entries
    a = [[ZERO, ZERO, ONE, ZERO], [ZERO, ZERO, ZERO, ONE], [ZERO, p1, p2, ZERO], [ZERO, p4, p5, ZERO]]
    return a, [ZERO, ZERO, p3, p6]


def from_b(b1, b2, b3, b4):
    """A, B at rest from b (table of elements, theta = theta_dot = 0)."""
    l, r_b, r_w, g = D("0.2978"), D("0.12"), D("0.05"), D("9.81")
    k = b2 - l * r_b
    d = b1 * b3 - k * k
    ratio = r_b / (r_w * d)
    return model([g * l * k / d, -b3 * b4 / d, ratio * (b3 - k), g * l * b1 / d, -b4 * k / d, ratio * (k - b1)])


def runge_kutta(a, b, t_s, substeps):
    """A_d, B_d of classical Runge-Kutta steps with a held input, stage by stage."""
    h = t_s / substeps

    def step(x, u):
        def f(z):
            return [sum(a[i][s] * z[s] for s in N) + b[i] * u for i in N]

        k1 = f(x)
        k2 = f([x[i] + h / 2 * k1[i] for i in N])
        k3 = f([x[i] + h / 2 * k2[i] for i in N])
        k4 = f([x[i] + h * k3[i] for i in N])
        return [x[i] + h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]) for i in N]

    def sample(x, u):
        for _ in range(substeps):
            x = step(x, u)
        return x

    columns = [sample([ONE if i == j else ZERO for i in N], ZERO) for j in N]
    return [[columns[j][i] for j in N] for i in N], sample([ZERO] * 4, ONE)


def show(name, result):
    k, p = result
    print(name)
    for label, values in (("K     ", k), ("diag P", p)):
        print("  ", label, ", ".join(f"{x:.16g}" for x in values))


P = [D(x) for x in ("-342.6038", "-52.8301", "-1425.9", "-36.0734", "-9.1477", "-251.8476")]
B = [D(x) for x in ("0.00248322", "0.0593257", "0.14309325", "-0.07436078")]
START = [D(x) for x in ("0.447", "-6.196", "0.215", "-1.301")]

show("p, continuous", newton(*model(P), START, discrete=False))
show("b, continuous", newton(*from_b(*B), START, discrete=False))
for substeps in (1, 4):
    sampled = runge_kutta(*from_b(*B), D("0.05"), substeps)
    start = [D(x) for x in ("0.271", "-2.866", "0.0995", "-0.621")]
    show(f"b, Runge-Kutta, {substeps} substeps of 0.05 s", newton(*sampled, start, discrete=True))
