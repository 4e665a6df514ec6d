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
        return _product(sp, tape, of, expression)
    if expression.is_Pow:
        return _power(sp, tape, of, *arguments)
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
        return _piecewise(sp, tape, of, arguments)
    raise PlantError(
        f"formulas: {name} in {expression} has no counterpart here; there are sums, products, "
        f"powers, {', '.join(_ALIKE)}, abs, atan2, Min, Max and Piecewise"
    )


def _product(sp: Any, tape: Tape, of: Any, expression: Any) -> int:
    numerator, denominator = expression.as_numer_denom()
    if denominator != 1 and not denominator.is_number:
        return tape.add("div", of(numerator), of(denominator))
    coefficient, rest = expression.as_coeff_Mul()
    if coefficient == -1:
        return tape.add("neg", of(rest))
    factors: list[int] = [of(part) for part in expression.args]
    place = factors[0]
    for factor in factors[1:]:
        place = tape.add("mul", place, factor)
    return place


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


def _piecewise(sp: Any, tape: Tape, of: Any, pieces: Any) -> int:
    """The sum of the pieces, each where its condition is the first that holds."""
    terms, none_before = [], None
    for value, condition in pieces:  # of which the last is `True`
        if condition == True:  # noqa: E712  (SymPy's own truth)
            here = none_before
        else:
            holds = _condition(sp, tape, of, condition)
            here = holds if none_before is None else tape.add("mul", none_before, holds)
            fails = tape.add("eq", holds, tape.constant(0.0))
            none_before = fails if none_before is None else tape.add("mul", none_before, fails)
        place = of(value)
        terms.append(place if here is None else tape.add("if_else_zero", here, place))
    return tape.sum(terms)


def _condition(sp: Any, tape: Tape, of: Any, condition: Any) -> int:
    name = type(condition).__name__
    comparisons = {
        "StrictLessThan": ("lt", False), "LessThan": ("le", False),
        "StrictGreaterThan": ("lt", True), "GreaterThan": ("le", True), "Equality": ("eq", False),
    }  # fmt: skip
    if name in comparisons:
        operation, turned = comparisons[name]
        left, right = (of(part) for part in condition.args)
        return tape.add(operation, right, left) if turned else tape.add(operation, left, right)
    if name in ("And", "Or"):
        parts = [_condition(sp, tape, of, part) for part in condition.args]
        place = parts[0]
        for part in parts[1:]:
            place = tape.add("mul" if name == "And" else "max", place, part)
        return place
    if name == "Not":
        return tape.add("eq", _condition(sp, tape, of, condition.args[0]), tape.constant(0.0))
    raise PlantError(f"formulas: the condition {condition} has no counterpart here")


def name(symbol: Any) -> str:
    """What a symbol, or a function of time, is called."""
    return str(getattr(symbol, "func", symbol) if getattr(symbol, "args", ()) else symbol)
