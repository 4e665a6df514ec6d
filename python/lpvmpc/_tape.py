"""Formulas as a straight-line program, the form in which a plant's file holds them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Operation = list[str | int | float]


class Tape:
    """Operations, each once.

    sin(x)/x is one of them, since it has a value at 0, too.
    """

    def __init__(self) -> None:
        self.operations: list[Operation] = []
        self._known: dict[tuple[str | int | float, ...], int] = {}

    def add(self, name: str, *arguments: int | float) -> int:
        """The place of the result of an operation."""
        operation: tuple[str | int | float, ...] = (name, *arguments)
        if name == "div" and self.operations[int(arguments[0])] == ["sin", arguments[1]]:
            operation = ("sinc", arguments[1])
        # 0.0 and -0.0 are equal, and not the same constant.
        key = (name, repr(arguments[0])) if name == "constant" else operation
        if key not in self._known:
            self._known[key] = len(self.operations)
            self.operations.append(list(operation))
        return self._known[key]

    def constant(self, value: float) -> int:
        """The place of a number."""
        return self.add("constant", float(value))

    def sum(self, terms: list[int]) -> int:
        """The place of a sum; of 0 without terms."""
        if not terms:
            return self.constant(0.0)
        total = terms[0]
        for term in terms[1:]:
            total = self.add("add", total, term)
        return total

    def product(self, factors: list[int]) -> int:
        """The place of a product; of 1 without factors."""
        if not factors:
            return self.constant(1.0)
        whole = factors[0]
        for factor in factors[1:]:
            whole = self.add("mul", whole, factor)
        return whole

    def affine(self, a: Array, b: Array, rest: Array) -> list[int]:
        """The places of the rows of a x + b u + rest."""
        places = []
        for a_row, b_row, constant in zip(a, b, rest, strict=True):
            terms = []
            for leaf, row in (("state", a_row), ("input", b_row)):
                for i, entry in enumerate(row):
                    if entry == 1.0:
                        terms.append(self.add(leaf, i))
                    elif entry != 0.0:
                        terms.append(self.add("mul", self.constant(entry), self.add(leaf, i)))
            if constant != 0.0:
                terms.append(self.constant(constant))
            places.append(self.sum(terms))
        return places
