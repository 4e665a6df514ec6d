"""Published solvers from their wheels. Each has its data in its own form before the time is taken:
`prepare(k)` gives the arguments for problem k, `call` hands them over and solves, and is all that is timed.
`first_input` reads u_0 of the last answer, or None where the solver says that it has none.
"""

import warnings

import clarabel
import daqp
import numpy as np
import osqp
import piqp
import quadprog
import scipy.sparse as sp

# OSQP's default way to report failure is about to change; the status is looked at here in any case.
warnings.filterwarnings("ignore", category=PendingDeprecationWarning)


class Daqp:
    """DAQP on the condensed problem: a dual active-set method. New data into the same workspace."""

    name = "DAQP"
    form = "dense"

    def __init__(self, forms, nu):
        self.nu = nu
        self.data = []
        for form in forms:
            h, a = np.ascontiguousarray(form.h), np.ascontiguousarray(form.a)
            upper = np.minimum(np.concatenate([form.z_upper, form.upper]), 1e30)
            lower = np.maximum(np.concatenate([form.z_lower, form.lower]), -1e30)
            self.data.append((h, form.f, a, upper, lower, np.zeros(len(upper), np.intc)))
        self.model = daqp.Model()
        self.model.settings = {"primal_tol": 1e-9}
        h, f, a, upper, lower, sense = self.data[0]
        self.model.setup(h, f, a, upper, lower, sense)

    def prepare(self, k):
        h, f, a, upper, lower, sense = self.data[k]
        return h, f, a, upper, lower, sense.copy()

    def call(self, arguments):
        h, f, a, upper, lower, sense = arguments
        self.model.update(h, f, a if len(a) else None, upper, lower, sense)
        self.answer = self.model.solve()

    def first_input(self):
        x, _, flag, _ = self.answer
        return x[: self.nu] if flag == 1 else None


class DaqpWarm(Daqp):
    """The same from the working set of the answer before."""

    name = "DAQP warm"

    def prepare(self, k):
        arguments = super().prepare(k)
        # Without new constraint types the working set stays; the first problem begins anew.
        return arguments if k == 0 else (*arguments[:-1], None)


class Quadprog:
    """quadprog on the condensed problem: the dual active-set method of Goldfarb and Idnani."""

    name = "quadprog"
    form = "dense"

    def __init__(self, forms, nu):
        self.nu = nu
        self.data = []
        for form in forms:
            identity = np.eye(len(form.f))
            rows = np.vstack([form.a, -form.a, identity, -identity])
            bounds = np.concatenate([form.lower, -form.upper, form.z_lower, -form.z_upper])
            there = np.isfinite(bounds)
            self.data.append((np.ascontiguousarray(form.h), -form.f,
                              np.ascontiguousarray(rows[there].T), bounds[there]))

    def prepare(self, k):
        return self.data[k]

    def call(self, arguments):
        try:
            self.answer = quadprog.solve_qp(*arguments)[0]
        except ValueError:
            self.answer = None

    def first_input(self):
        return None if self.answer is None else self.answer[: self.nu]


class Piqp:
    """PIQP: a proximal interior-point method, new data into the same solver. With its default tolerance, 1e-8,
    answers can be too far off."""

    def __init__(self, forms, nu, tolerance=1e-10):
        self.nu = nu
        self.data = [self.arguments(form) for form in forms]
        self.solver = self.new_solver()
        self.solver.settings.compute_timings = False
        self.solver.settings.eps_abs = self.solver.settings.eps_duality_gap_abs = tolerance
        self.solver.settings.eps_rel = self.solver.settings.eps_duality_gap_rel = 0.1 * tolerance
        self.solver.setup(*self.data[0])

    def prepare(self, k):
        return self.data[k]

    def call(self, arguments):
        self.solver.update(*arguments)
        self.status = self.solver.solve()

    def first_input(self):
        solved = self.status == piqp.PIQP_SOLVED
        return self.solver.result.x[: self.nu].copy() if solved else None


class PiqpDense(Piqp):
    """On the condensed problem."""

    name = "PIQP dense"
    form = "dense"

    def new_solver(self):
        return piqp.DenseSolver()

    def arguments(self, form):
        return (np.asfortranarray(form.h), form.f, None, None, np.asfortranarray(form.a), form.lower,
                form.upper, form.z_lower, form.z_upper)


class PiqpMultistage(Piqp):
    """On the sparse problem, whose stages its backend recognises."""

    name = "PIQP multistage"
    form = "sparse"

    def new_solver(self):
        solver = piqp.SparseSolver()
        solver.settings.kkt_solver = piqp.sparse_multistage
        return solver

    def arguments(self, form):
        return (form.p, form.q, form.a, form.b, form.g, form.lower, form.upper, form.z_lower, form.z_upper)


def _stacked(form, one_sided):
    """The bounds as rows behind the equations, with their right-hand sides."""
    identity = sp.identity(len(form.q), format="csc")
    rows = sp.vstack([identity, form.g]).tocsr()
    lower = np.concatenate([form.z_lower, form.lower])
    upper = np.concatenate([form.z_upper, form.upper])
    if not one_sided:
        there = np.isfinite(lower) | np.isfinite(upper)
        return (sp.csc_matrix(sp.vstack([form.a, rows[there]])), np.concatenate([form.b, lower[there]]),
                np.concatenate([form.b, upper[there]]))
    above, below = np.isfinite(upper), np.isfinite(lower)
    matrix = sp.vstack([form.a, rows[above], -rows[below]])
    return sp.csc_matrix(matrix), np.concatenate([form.b, upper[above], -lower[below]])


class Clarabel:
    """Clarabel on the sparse problem: an interior-point method, new data into the same solver."""

    name = "Clarabel"
    form = "sparse"

    def __init__(self, forms, nu):
        self.nu = nu
        self.data = []
        for form in forms:
            matrix, right = _stacked(form, one_sided=True)
            triangle = sp.csc_matrix(sp.triu(form.p))
            self.data.append((triangle, form.q, matrix, right))
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.presolve_enable = False
        settings.input_sparse_dropzeros = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
        equations = len(forms[0].b)
        triangle, q, matrix, right = self.data[0]
        cones = [clarabel.ZeroConeT(equations), clarabel.NonnegativeConeT(len(right) - equations)]
        self.solver = clarabel.DefaultSolver(triangle, q, matrix, right, cones, settings)

    def prepare(self, k):
        triangle, q, matrix, right = self.data[k]
        return triangle.data, q, matrix.data, right

    def call(self, arguments):
        p, q, a, b = arguments
        self.solver.update(P=p, q=q, A=a, b=b)
        self.answer = self.solver.solve()

    def first_input(self):
        solved = self.answer.status == clarabel.SolverStatus.Solved
        return np.array(self.answer.x[: self.nu]) if solved else None


class Osqp:
    """OSQP on the sparse problem: operator splitting with polishing, new data into the same solver, from
    the answer before."""

    name = "OSQP"
    form = "sparse"

    def __init__(self, forms, nu):
        self.nu = nu
        self.data = []
        for form in forms:
            matrix, lower, upper = _stacked(form, one_sided=False)
            self.data.append((sp.csc_matrix(sp.triu(form.p)), form.q, matrix, lower, upper))
        triangle, q, matrix, lower, upper = self.data[0]
        self.solver = osqp.OSQP()
        # It keeps the matrices, and writes later data into them.
        self.solver.setup(triangle.copy(), q, matrix.copy(), lower, upper, verbose=False, eps_abs=1e-8, eps_rel=1e-8,
                          max_iter=20000, polishing=True)

    def prepare(self, k):
        triangle, q, matrix, lower, upper = self.data[k]
        return triangle.data, q, matrix.data, lower, upper

    def call(self, arguments):
        p, q, a, lower, upper = arguments
        self.solver.update(Px=p, q=q, Ax=a, l=lower, u=upper)
        self.answer = self.solver.solve()

    def first_input(self):
        solved = self.answer.info.status_val == osqp.SolverStatus.OSQP_SOLVED
        # The solver writes its next answer to the same place.
        return self.answer.x[: self.nu].copy() if solved else None


ALL = [Daqp, DaqpWarm, Quadprog, PiqpDense, PiqpMultistage, Clarabel, Osqp]
