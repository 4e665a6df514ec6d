"""The problem as other solvers want it: sparse, with the states as variables, or condensed to the inputs.

A soft bound gets a slack s >= 0 that costs linear*s + quadratic*s^2/2 and loosens both of its sides.
"""

import dataclasses

import numpy as np
import scipy.sparse as sp


@dataclasses.dataclass
class Sparse:
    """min z'Pz/2 + q'z with A z = b, lower <= G z <= upper, z_lower <= z <= z_upper. Variables stage by
    stage: x_i (but for x_0, which is given), u_i, slacks."""

    p: sp.csc_matrix
    q: np.ndarray
    a: sp.csc_matrix
    b: np.ndarray
    g: sp.csc_matrix
    lower: np.ndarray
    upper: np.ndarray
    z_lower: np.ndarray
    z_upper: np.ndarray


@dataclasses.dataclass
class Dense:
    """min z'Hz/2 + f'z with lower <= A z <= upper, z_lower <= z <= z_upper. Variables: inputs, slacks."""

    h: np.ndarray
    f: np.ndarray
    a: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    z_lower: np.ndarray
    z_upper: np.ndarray


def _rows(stage, first, last):
    """Bounded rows of a stage: hard simple bounds of x apart, as (C, D, lower, upper, linear, quadratic)."""
    identity = np.eye(len(stage.x_lower))
    finite = np.isfinite(stage.x_lower) | np.isfinite(stage.x_upper)
    of_x = np.zeros(len(finite), bool) if first else finite & np.isfinite(stage.x_linear)
    of_rows = np.isfinite(stage.rows_lower) | np.isfinite(stage.rows_upper)
    nu = 0 if last else stage.b.shape[1]
    c = np.vstack([identity[of_x], stage.rows_x[of_rows]])
    d = np.vstack([np.zeros((of_x.sum(), nu)), stage.rows_u[of_rows]])
    pick = lambda x, rows: np.concatenate([x[of_x], rows[of_rows]])
    return (c, d, pick(stage.x_lower, stage.rows_lower), pick(stage.x_upper, stage.rows_upper),
            pick(stage.x_linear, stage.rows_linear), pick(stage.x_quadratic, stage.rows_quadratic))


def _with_slacks(c_d, lower, upper, soft):
    """Rows of (x, u, slacks): a soft one becomes two, each with its slack."""
    count = int(soft.sum())
    hard = ~soft
    matrix = np.vstack([
        np.hstack([c_d[hard], np.zeros((hard.sum(), count))]),
        np.hstack([c_d[soft], -np.eye(count)]),
        np.hstack([c_d[soft], np.eye(count)]),
    ])
    infinite = np.full(count, np.inf)
    return (matrix, np.concatenate([lower[hard], -infinite, lower[soft]]),
            np.concatenate([upper[hard], upper[soft], infinite]))


def sparse(problem):
    """The sparse form; entries that are zero in the blocks are kept, so that patterns do not change."""
    p, q, g, g_lower, g_upper, lower, upper, widths, parts = [], [], [], [], [], [], [], [], []
    last = len(problem.stages) - 1
    for i, stage in enumerate(problem.stages):
        first = i == 0
        nx, nu = (0 if first else len(stage.linear_x)), stage.r.shape[0]
        c, d, rows_lower, rows_upper, linear, quadratic = _rows(stage, first, i == last)
        shift = c @ problem.x0 if first else 0.0
        soft = np.isfinite(linear)
        matrix, rows_lower, rows_upper = _with_slacks(
            np.hstack([c[:, :nx], d]), rows_lower - shift, rows_upper - shift, soft)
        cost = np.zeros((nx + nu, nx + nu))
        cost[:nx, :nx], cost[nx:, nx:] = stage.q[:nx, :nx], stage.r
        cost[nx:, :nx] = stage.s[:, :nx]
        cost[:nx, nx:] = stage.s[:, :nx].T
        p.append(np.block([[cost, np.zeros((nx + nu, soft.sum()))],
                           [np.zeros((soft.sum(), nx + nu)), np.diag(quadratic[soft])]]))
        of_u = stage.linear_u + (stage.s @ problem.x0 if first else 0.0)
        q += [stage.linear_x[:nx], of_u, linear[soft]]
        hard = ~np.isfinite(stage.x_linear[:nx])
        lower += [np.where(hard, stage.x_lower[:nx], -np.inf), stage.u_lower, np.zeros(soft.sum())]
        upper += [np.where(hard, stage.x_upper[:nx], np.inf), stage.u_upper, np.full(soft.sum(), np.inf)]
        g.append(matrix)
        g_lower.append(rows_lower)
        g_upper.append(rows_upper)
        widths.append(nx + nu + soft.sum())
        parts.append((nx, nu))
    a, b = _dynamics(problem, widths, parts)
    return Sparse(_blocks(p), np.concatenate(q), a, b, _blocks(g), np.concatenate(g_lower),
                  np.concatenate(g_upper), np.concatenate(lower), np.concatenate(upper))


def _blocks(blocks):
    """Block-diagonal without entries that are zero."""
    return sp.csc_matrix(sp.block_diag([sp.csc_matrix(block) for block in blocks], format="csc"))


def _dynamics(problem, widths, parts):
    begin = np.concatenate([[0], np.cumsum(widths)])
    nx = len(problem.x0)
    steps = problem.stages[:-1]
    a = sp.lil_matrix((nx * len(steps), begin[-1]))
    b = np.zeros(nx * len(steps))
    for i, stage in enumerate(steps):
        rows = slice(i * nx, (i + 1) * nx)
        of_x, of_u = parts[i]
        a[rows, begin[i] : begin[i] + of_x] = stage.a[:, :of_x]
        a[rows, begin[i] + of_x : begin[i] + of_x + of_u] = stage.b
        a[rows, begin[i + 1] : begin[i + 1] + nx] = -np.eye(nx)
        b[rows] = -stage.c - (stage.a @ problem.x0 if i == 0 else 0.0)
    return sp.csc_matrix(a), b


def condense(problem):
    """The states eliminated."""
    steps = problem.stages[:-1]
    nx, nu, n = len(problem.x0), steps[0].r.shape[0], len(steps)
    # Of x_i: the part that the inputs do not move, and how they move it.
    free, moved = problem.x0, np.zeros((nx, n * nu))
    h, f = np.zeros((n * nu, n * nu)), np.zeros(n * nu)
    rows, lower, upper, linear, quadratic = [], [], [], [], []
    for i, stage in enumerate(problem.stages):
        inputs = slice(i * nu, (i + 1) * nu) if i < n else slice(0, 0)
        c, d, rows_lower, rows_upper, price, curvature = _rows(stage, i == 0, i == n)
        hard = (np.isfinite(stage.x_lower) | np.isfinite(stage.x_upper)) & ~np.isfinite(stage.x_linear)
        hard &= i > 0
        of_stage = np.vstack([moved[hard], c @ moved])
        of_stage[hard.sum() :, inputs] += d
        offset = np.concatenate([free[hard], c @ free])
        rows.append(of_stage)
        lower.append(np.concatenate([stage.x_lower[hard], rows_lower]) - offset)
        upper.append(np.concatenate([stage.x_upper[hard], rows_upper]) - offset)
        linear.append(np.concatenate([np.full(hard.sum(), np.inf), price]))
        quadratic.append(np.concatenate([np.zeros(hard.sum()), curvature]))
        weighted = stage.q @ moved
        seen = slice(0, min(i, n) * nu)  # the inputs that move x_i
        h[seen, seen] += moved[:, seen].T @ weighted[:, seen]
        f[seen] += moved[:, seen].T @ (stage.q @ free + stage.linear_x)
        if i < n:
            cross = stage.s @ moved
            h[inputs, :] += cross
            h[:, inputs] += cross.T
            h[inputs, inputs] += stage.r
            f[inputs] += stage.linear_u + stage.s @ free
            free, moved = stage.a @ free + stage.c, stage.a @ moved
            moved[:, inputs] += stage.b
    return _dense(problem, h, f, *(np.concatenate(part) for part in (rows, lower, upper, linear, quadratic)))


def _dense(problem, h, f, rows, lower, upper, linear, quadratic):
    soft = np.isfinite(linear)
    count, inputs = soft.sum(), len(f)
    matrix, lower, upper = _with_slacks(rows, lower, upper, soft)
    full = np.zeros((inputs + count, inputs + count))
    full[:inputs, :inputs] = h
    full[inputs:, inputs:] = np.diag(quadratic[soft])
    steps = problem.stages[:-1]
    zeros, infinite = np.zeros(count), np.full(count, np.inf)
    return Dense(full, np.concatenate([f, linear[soft]]), matrix, lower, upper,
                 np.concatenate([*(stage.u_lower for stage in steps), zeros]),
                 np.concatenate([*(stage.u_upper for stage in steps), infinite]))
