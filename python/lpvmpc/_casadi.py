"""Formulas of CasADi as a tape."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._tape import Tape
from .errors import MissingPackageError, PlantError

if TYPE_CHECKING:
    from ._sources import Embedding


def casadi() -> Any:
    """The package casadi."""
    try:
        import casadi as ca
    except ImportError as error:
        raise MissingPackageError(
            "this needs CasADi: pip install casadi, or pip install lpvmpc[casadi]"
        ) from error
    return ca


# Operations that are called alike in a file.
_NAMES = {
    "ADD": "add", "SUB": "sub", "MUL": "mul", "DIV": "div", "NEG": "neg", "EXP": "exp",
    "LOG": "log", "POW": "pow", "CONSTPOW": "pow", "SQRT": "sqrt", "SQ": "sq", "INV": "inv",
    "SIN": "sin", "COS": "cos", "TAN": "tan", "ASIN": "asin", "ACOS": "acos", "ATAN": "atan",
    "ATAN2": "atan2", "SINH": "sinh", "COSH": "cosh", "TANH": "tanh", "ASINH": "asinh",
    "ACOSH": "acosh", "ATANH": "atanh", "EXPM1": "expm1", "LOG1P": "log1p", "FABS": "abs",
    "SIGN": "sign", "FLOOR": "floor", "FMIN": "min", "FMAX": "max", "LT": "lt", "LE": "le",
    "EQ": "eq", "IF_ELSE_ZERO": "if_else_zero",
}  # fmt: skip


def column(expressions: Any) -> Any:
    """Expressions, as one or as a list, as a dense column."""
    ca = casadi()
    if isinstance(expressions, (list, tuple)):
        return ca.densify(ca.vertcat(*expressions))
    if hasattr(expressions, "cat"):  # a structure of casadi.tools
        expressions = expressions.cat
    return ca.densify(ca.vec(expressions))


def symbols(place: str, given: Any) -> list[Any]:
    """Symbols, as one or as a list, as a list of scalars and columns."""
    ca = casadi()
    if given is None:
        return []
    if hasattr(given, "cat"):
        given = given.cat
    each = list(given) if isinstance(given, (list, tuple)) else [given]
    each = [one for one in each if not (hasattr(one, "numel") and one.numel() == 0)]
    for one in each:
        if not isinstance(one, (ca.SX, ca.MX)) or not one.is_valid_input():
            raise PlantError(f"{place}: {one} is no symbol of CasADi; give SX.sym or MX.sym")
    return each


def names(symbols: list[Any]) -> list[str]:
    """What the entries of symbols are called."""
    found: list[str] = []
    for one in symbols:
        if type(one).__name__ == "MX" and one.numel() > 1:
            found += [f"{one.name()}_{i}" for i in range(one.numel())]
        else:
            found += [str(one[i]) for i in range(one.numel())]
    return found


def take(tape: Tape, inputs: list[tuple[str, list[Any]]], outputs: list[Any]) -> list[list[int]]:
    """The places of `outputs` on the tape.

    `outputs` are dense columns of the symbols `inputs`, each list of which is one vector with the name
    that its entries have on the tape.

    Raises
    ------
    PlantError
        The outputs depend on other symbols, or use an operation that no tape has.
    """
    ca = casadi()
    leaves = []  # of each symbol: name, first entry
    for name, group in inputs:
        first = 0
        for symbol in group:
            leaves.append((name, first))
            first += symbol.numel()
    every = [symbol for _, group in inputs for symbol in group]
    try:
        function = ca.Function("f", every, outputs, {"cse": True})
        if not function.is_a("SXFunction"):
            function = function.expand()
    except RuntimeError as error:
        raise PlantError(f"formulas: CasADi says: {_last_line(error)}") from error
    by_number = {getattr(ca, f"OP_{name}"): ours for name, ours in _NAMES.items()}
    results: list[list[int]] = [[0] * function.nnz_out(i) for i in range(function.n_out())]
    work: dict[int, int] = {}
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        arguments, places = function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_INPUT:
            name, first = leaves[arguments[0]]
            work[places[0]] = tape.add(name, first + arguments[1])
        elif code == ca.OP_CONST:
            work[places[0]] = tape.constant(function.instruction_constant(k))
        elif code == ca.OP_OUTPUT:
            results[places[0]][places[1]] = work[arguments[0]]
        else:
            work[places[0]] = _operation(ca, tape, by_number, code, [work[a] for a in arguments])
    return results


def _operation(
    ca: Any, tape: Tape, by_number: dict[int, str], code: int, of: list[int]
) -> int:
    """An operation of CasADi; some of them are several of a tape."""
    if code in by_number:
        return tape.add(by_number[code], *of)
    if code == ca.OP_TWICE:
        return tape.add("add", of[0], of[0])
    if code == ca.OP_NOT:
        return tape.add("eq", of[0], tape.constant(0.0))
    if code == ca.OP_NE:
        return tape.add("eq", tape.add("eq", *of), tape.constant(0.0))
    truth = [_truth(tape, a) for a in of]
    if code == ca.OP_AND:
        return tape.add("mul", *truth)
    if code == ca.OP_OR:
        return tape.add("max", *truth)
    if code == ca.OP_HYPOT:
        squares = [tape.add("sq", a) for a in of]
        return tape.add("sqrt", tape.add("add", *squares))
    if code == ca.OP_ASSIGN:
        return of[0]
    if code == ca.OP_CEIL:
        return tape.add("neg", tape.add("floor", tape.add("neg", of[0])))
    known = ", ".join(sorted({*_NAMES.values()}))
    names = [name for name in dir(ca) if name.startswith("OP_") and getattr(ca, name) == code]
    called = names[0].removeprefix("OP_").lower() if names else f"number {code}"
    raise PlantError(
        f"formulas: the operation {called} of CasADi has no counterpart here; there are {known}"
    )


def _truth(tape: Tape, place: int) -> int:
    """1 where a result is not 0, else 0; what is one of them already stays."""
    if tape.operations[place][0] in ("lt", "le", "eq"):
        return place
    return tape.add("eq", tape.add("eq", place, tape.constant(0.0)), tape.constant(0.0))


def _last_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1] if lines else "nothing"


def embedding(
    tape: Tape, given: Embedding, groups: list[tuple[str, list[Any]]], sizes: tuple[int, int]
) -> dict[str, Any]:
    """An embedding as a file has it: the places of sigma, of the rows of A and B, and of c."""
    n, m = sizes
    (scheduling,) = take(tape, groups, [column(given.sigma)])
    own = [("scheduling", symbols("embedding, s", given.s)), groups[-1]]
    formulas = []
    for name, matrix, columns in (("a", given.a, n), ("b", given.b, m)):
        if tuple(getattr(matrix, "shape", ())) != (n, columns):
            raise PlantError(f"embedding, {name}: it must be an expression of shape ({n}, {columns})")
        formulas.append(column(matrix.T))  # row by row
    if given.c is not None:
        formulas.append(column(given.c))
    a, b, *c = take(tape, own, formulas)
    found: dict[str, Any] = {
        "scheduling": scheduling,
        "a": [a[i * n : (i + 1) * n] for i in range(n)],
        "b": [b[i * m : (i + 1) * m] for i in range(n)],
    }
    if c:
        found["c"] = c[0]
    return found


def labels(structure: Any) -> list[str]:
    """What the entries of a structure of do-mpc are called; it may have empty ones."""
    found: list[str] = []
    for key in structure.keys():
        count = structure[key].numel()
        found += [key] if count == 1 else [f"{key}_{i}" for i in range(count)]
    return found
