"""Formulas of SymPy as a tape."""

from __future__ import annotations

from typing import Any

from ._tape import Tape
from .errors import MissingPackageError, PlantError


def sympy() -> Any:
    """The package sympy."""
    try:
        import sympy as sp
    except ImportError as error:
        raise MissingPackageError(
            "this needs SymPy: pip install sympy, or pip install lpvmpc[sympy]"
        ) from error
    return sp


# Functions of one argument that are called alike in a file.
_ALIKE = [
    "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh",
    "acosh", "atanh", "sinc", "sign", "floor",
]  # fmt: skip


def take(tape: Tape, leaves: dict[Any, tuple[str, int]], outputs: list[Any]) -> list[int]:
    """The places on the tape of expressions `outputs` of the symbols `leaves`, each with the name that it has on
    the tape and its place there."""
    sp = sympy()
    formulas = [sp.sympify(output) for output in outputs]
    for formula in formulas:
        for pieces in formula.atoms(sp.Piecewise):
            _check_otherwise(pieces)
    replacements, reduced = sp.cse(formulas)
    known = {symbol: tape.add(name, index) for symbol, (name, index) in leaves.items()}
    for symbol, expression in replacements:
        known[symbol] = _place(sp, tape, known, expression)
    return [_place(sp, tape, known, expression) for expression in reduced]


def _check_otherwise(pieces: Any) -> None:
    """Refuses a formula that has no value where none of its conditions holds."""
    if pieces.args[-1].cond != True:  # noqa: E712  (SymPy's own truth)
        raise PlantError(
            f"formulas: {pieces} has no value where none of its conditions holds; add an otherwise branch, "
            "(value, True), as its last piece"
        )


def _place(sp: Any, tape: Tape, known: dict[Any, int], expression: Any) -> int:
    def of(part: Any) -> int:
        return _place(sp, tape, known, part)

    if expression in known:
        return known[expression]
    if expression.is_number:
        value = complex(expression.evalf(20))
        if value.imag != 0:
            raise PlantError(f"formulas: {expression} is no real number")
        return tape.constant(value.real)
    if expression.is_Symbol:
        raise PlantError(
            f"formulas: {expression} is neither a state nor an input nor a parameter"
        )
    arguments = expression.args
    if expression.is_Add:
        return tape.sum([of(part) for part in arguments])
    if expression.is_Mul:
        return _product(sp, tape, of, arguments)
    if expression.is_Pow:
        return _power(sp, tape, of, *arguments)
    if isinstance(expression, sp.logic.boolalg.Boolean):
        return _condition(tape, of, expression)
    name = type(expression).__name__
    if name in _ALIKE:
        return tape.add(name, of(arguments[0]))
    if name == "Abs":
        return tape.add("abs", of(arguments[0]))
    if name == "atan2":
        return tape.add("atan2", of(arguments[0]), of(arguments[1]))
    if name in ("Min", "Max"):
        place = of(arguments[0])
        for part in arguments[1:]:
            place = tape.add(name.lower(), place, of(part))
        return place
    if name == "Piecewise":
        return _piecewise(tape, of, arguments)
    raise PlantError(
        f"formulas: {name} in {expression} has no counterpart here; there are sums, products, "
        f"powers, {', '.join(_ALIKE)}, abs, atan2, Min, Max and Piecewise"
    )


def _product(sp: Any, tape: Tape, of: Any, factors: Any) -> int:
    """Divides by what is a power with a negative exponent, and by nothing else: in SymPy's own fraction v exp(-v**2) is
    v / exp(v**2), and a sum has a common denominator, which overflow where the formula does not."""
    above, below = [], []
    for factor in factors:
        if factor.is_Pow and factor.exp.is_number and factor.exp.is_negative:
            below.append(of(sp.Pow(factor.base, -factor.exp)))
        elif factor != -1:
            above.append(of(factor))
    place = tape.product(above)
    if -1 in factors:
        place = tape.add("neg", place)
    return tape.add("div", place, tape.product(below)) if below else place


def _power(sp: Any, tape: Tape, of: Any, base: Any, exponent: Any) -> int:
    if exponent == 2:
        return tape.add("sq", of(base))
    if exponent == -1:
        return tape.add("inv", of(base))
    if exponent == sp.Rational(1, 2):
        return tape.add("sqrt", of(base))
    if base == sp.E:
        return tape.add("exp", of(exponent))
    return tape.add("pow", of(base), of(exponent))


def _piecewise(tape: Tape, of: Any, pieces: Any) -> int:
    """The sum of the pieces, each where its condition is the first that holds."""
    terms, none_before = [], None
    for value, condition in pieces:  # of which the last is `True`
        if condition == True:  # noqa: E712  (SymPy's own truth)
            here = none_before
        else:
            holds = of(condition)
            here = holds if none_before is None else tape.add("mul", none_before, holds)
            fails = tape.add("eq", holds, tape.constant(0.0))
            none_before = fails if none_before is None else tape.add("mul", none_before, fails)
        place = of(value)
        terms.append(place if here is None else tape.add("if_else_zero", here, place))
    return tape.sum(terms)


def _condition(tape: Tape, of: Any, condition: Any) -> int:
    name = type(condition).__name__
    comparisons = {
        "StrictLessThan": ("lt", False), "LessThan": ("le", False),
        "StrictGreaterThan": ("lt", True), "GreaterThan": ("le", True), "Equality": ("eq", False),
    }  # fmt: skip
    parts: list[int] = [of(part) for part in condition.args]
    if name in comparisons:
        operation, turned = comparisons[name]
        return tape.add(operation, *(reversed(parts) if turned else parts))
    if name in ("And", "Or"):
        place = parts[0]
        for part in parts[1:]:
            place = tape.add("mul" if name == "And" else "max", place, part)
        return place
    if name == "Not":
        return tape.add("eq", parts[0], tape.constant(0.0))
    raise PlantError(f"formulas: the condition {condition} has no counterpart here")


def name(symbol: Any) -> str:
    """What a symbol, or a function of time, is called."""
    return str(getattr(symbol, "func", symbol) if getattr(symbol, "args", ()) else symbol)
