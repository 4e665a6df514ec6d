"""Our solver by its C interface."""

import ctypes

import numpy as np

COLD, SHIFTED = 0, 2


class Library:
    """The shared library."""

    def __init__(self, path):
        self.c = ctypes.CDLL(str(path))
        handle, number, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_int
        size, pointer = ctypes.c_size_t, ctypes.POINTER
        numbers = pointer(number)
        signatures = {
            "lpvmpc_problem_new": [integer] * 5 + [pointer(handle)],
            "lpvmpc_problem_set_all": [handle, numbers, size],
            "lpvmpc_solver_new": [handle, pointer(handle)],
            "lpvmpc_solve": [handle, handle, integer],
            "lpvmpc_status": [handle, pointer(integer)],
            "lpvmpc_inputs": [handle, numbers, size],
            "lpvmpc_kkt_residual": [handle, handle, numbers],
            "lpvmpc_active": [handle, pointer(integer), pointer(integer)],
            "lpvmpc_nothing": [],
        }
        for name, types in signatures.items():
            getattr(self.c, name).argtypes = types
        for name in ("lpvmpc_problem_free", "lpvmpc_solver_free"):
            getattr(self.c, name).argtypes = [handle]
            getattr(self.c, name).restype = None


def _must(code):
    if code != 0:
        raise RuntimeError(f"lpvmpc: code {code}")


class Own:
    """Cold or warm (from the answer before, one stage earlier); problem 0 begins the sequence anew."""

    def __init__(self, library, sequence, warm):
        self.c = library.c
        self.start = SHIFTED if warm else COLD
        self.nu = sequence.nu
        self.count = sequence.horizon * sequence.nu
        self.problems = []
        for numbers in sequence.numbers:
            problem = ctypes.c_void_p()
            _must(self.c.lpvmpc_problem_new(sequence.nx, sequence.nu, sequence.horizon, sequence.rows,
                                            sequence.common, ctypes.byref(problem)))
            row = np.ascontiguousarray(numbers)
            pointer = row.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
            _must(self.c.lpvmpc_problem_set_all(problem, pointer, len(row)))
            self.problems.append(problem)
        self.solver = ctypes.c_void_p()
        _must(self.c.lpvmpc_solver_new(self.problems[0], ctypes.byref(self.solver)))
        self.solve_of_c = self.c.lpvmpc_solve

    def prepare(self, k):
        """The arguments of the call that is timed."""
        return self.solver, self.problems[k], COLD if k == 0 else self.start

    def call(self, arguments):
        """What is timed."""
        self.solve_of_c(*arguments)

    def first_input(self):
        """u_0 of the last answer, or None."""
        status = ctypes.c_int()
        _must(self.c.lpvmpc_status(self.solver, ctypes.byref(status)))
        if status.value != 0:
            return None
        u = np.zeros(self.count)
        pointer = u.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        _must(self.c.lpvmpc_inputs(self.solver, pointer, self.count))
        return u[: self.nu]

    def residual(self, k):
        """The residual of the optimality conditions at the last answer, that of problem k."""
        value = ctypes.c_double()
        _must(self.c.lpvmpc_kkt_residual(self.solver, self.problems[k], ctypes.byref(value)))
        return value.value

    def close(self):
        """Frees what C holds."""
        for problem in self.problems:
            self.c.lpvmpc_problem_free(problem)
        self.c.lpvmpc_solver_free(self.solver)
