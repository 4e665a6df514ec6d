"""Where plants come from: their files, CasADi, do-mpc, acados, SymPy and matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _casadi, _lpvmpc, _plant_file, _sympy
from ._arrays import by_name, column, table
from ._tape import Tape
from .errors import PlantError

Array = NDArray[np.float64]
Kind = TypeVar("Kind", bound="PlantSources")


@dataclass(frozen=True)
class Embedding:
    """A plant's own linear parameter-varying form, f = A(s) x + B(s) u + c(s) with s = sigma(x, u), in
    expressions of CasADi.

    It must be f itself, not its linearisation, at every s; ``ca.sin(s) / s`` is 1 at zero if it is written as
    one quotient. From far away it leads to better plans than derivatives
    do, and certificates need one.
    """

    s: Any
    """The scheduling, symbols."""
    sigma: Any
    """sigma(x, u, p), what they are at a state and an input."""
    a: Any
    """A(s, p), shape (n, n)."""
    b: Any
    """B(s, p), shape (n, m)."""
    c: Any = None
    """c(s, p), shape (n,); none without."""


class PlantSources:
    """A plant as it is made: of its file, of models in other tools, or of matrices."""

    def __init__(self, native: _lpvmpc.Plant) -> None:
        if not isinstance(native, _lpvmpc.Plant):
            raise TypeError("make a plant by Plant.from_casadi, Plant.load and their like")
        self._native = native

    @classmethod
    def from_json(cls: type[Kind], text: str) -> Kind:
        """The plant in the text of a file.

        Raises
        ------
        PlantError
            It is no plant; the message names the place.
        """
        return cls(_lpvmpc.Plant.from_json(text))

    @classmethod
    def load(cls: type[Kind], path: str | PathLike[str]) -> Kind:
        """The plant in the file at `path`.

        Raises
        ------
        PlantError
            The file cannot be read, or is no plant; the message names the place.
        """
        return cls(_lpvmpc.Plant.load(Path(path)))

    @classmethod
    def from_casadi(
        cls: type[Kind],
        x: Any,
        u: Any,
        xdot: Any,
        *,
        p: Any = None,
        y: Any = None,
        name: str = "plant",
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        parameters: Mapping[str, float] | Sequence[float] | None = None,
        units: Mapping[str, str] | None = None,
        bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
        equilibrium: tuple[ArrayLike, ArrayLike] | None = None,
        embedding: Embedding | None = None,
        period: float | None = None,
    ) -> Kind:
        """A plant from CasADi expressions.

        Parameters
        ----------
        x, u
            The states and inputs, ``SX`` or ``MX`` symbols: a column, or a list of symbols.
        xdot
            f(x, u, p), the derivatives of the states in state units per second, or with a `period` the
            states one period later: a column, or a list.
        p
            The parameters, symbols as `x`.
        y
            g(x, u, p), the outputs: a column, or a list.
        name
            What the plant is called.
        states, inputs, outputs
            Their names. Without: what the symbols are called, and ``y_0``, ``y_1``, ...
        parameters
            The values of `p`: by the names of its symbols, in any order; by other names, which they are to have, in
            the order of `p`; or as a list. A Series of pandas with names is taken by these.
        units
            Units by name, for messages and figures.
        bounds
            (lower, upper) by name of a state, an input or an output, in its unit; None where there is none.
        equilibrium
            A steady state (x, u), f(x, u) = 0, or with a `period` f(x, u) = x.
        embedding
            The plant's own linear parameter-varying form, if it has one.
        period
            The period of a plant in discrete time, s; none in continuous time.

        Raises
        ------
        PlantError
            The expressions make no plant; the message names the place.
        MissingPackageError
            CasADi is not installed.

        Examples
        --------
        >>> import casadi as ca
        >>> import lpvmpc
        >>> x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
        >>> pendulum = lpvmpc.Plant.from_casadi(
        ...     x, u, ca.vertcat(x[1], 9.81 * ca.sin(x[0]) + u),
        ...     states=["angle", "rate"], inputs=["torque"],
        ...     units={"angle": "rad", "rate": "rad/s", "torque": "N m"},
        ...     bounds={"torque": (-8, 8)}, equilibrium=([0, 0], [0]),
        ... )
        >>> pendulum.f([0.5, 0.1], [2.0]).round(3).tolist()
        [0.1, 6.703]
        """
        xs, us = _casadi.symbols("x", x), _casadi.symbols("u", u)
        ps = _casadi.symbols("p", p)
        groups = [("state", xs), ("input", us), ("parameter", ps)]
        formulas = [_casadi.column(xdot)]
        if y is not None:
            formulas.append(_casadi.column(y))
        tape = Tape()
        results = _casadi.take(tape, groups, formulas)
        sizes = (sum(one.numel() for one in xs), sum(one.numel() for one in us))
        text = _plant_file.text(
            tape,
            derivative=results[0],
            output=results[1] if y is not None else [],
            name=name,
            states=_plant_file.names("states", states, _casadi.names(xs)),
            inputs=_plant_file.names("inputs", inputs, _casadi.names(us)),
            outputs=outputs,
            parameters=_plant_file.values(parameters, _casadi.names(ps)),
            units=units,
            bounds=bounds,
            equilibrium=equilibrium,
            embedding=None if embedding is None else _casadi.embedding(tape, embedding, groups, sizes),
            period=period,
        )
        return cls.from_json(text)

    @classmethod
    def from_do_mpc(
        cls: type[Kind],
        model: Any,
        *,
        parameters: Mapping[str, float] | Sequence[float] | None = None,
        units: Mapping[str, str] | None = None,
        bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
        equilibrium: tuple[ArrayLike, ArrayLike] | None = None,
        period: float | None = None,
    ) -> Kind:
        """The plant of a do-mpc ``Model`` after its ``setup()``.

        Its time-varying parameters become parameters after the others (`Mpc.step` takes them by stage).

        Parameters
        ----------
        model
            A ``do_mpc.model.Model`` without algebraic states.
        parameters
            The values of its parameters, by name or in its order.
        units, bounds, equilibrium
            As of `from_casadi`.
        period
            The period of a discrete model, s.

        Raises
        ------
        PlantError
            The model is none that can be a plant: the message says why.
        """
        if not getattr(model, "flags", {}).get("setup", False):
            raise PlantError("model: call its setup() first")
        if model.model_type != "continuous" and period is None:
            raise PlantError(f"period: the model is {model.model_type}, so it needs one, in s")
        if model.model_type == "continuous" and period is not None:
            raise PlantError("period: the model is continuous, and has none")
        if model.n_z:
            raise PlantError(
                f"model: it has {model.n_z} algebraic states; solve for them and put them in"
            )
        return cls.from_casadi(
            model._x,
            model._u,
            model._rhs,  # what setup() has made of set_rhs()
            p=[model._p.cat, model._tvp.cat],
            name="do-mpc",
            states=_casadi.labels(model._x),
            inputs=_casadi.labels(model._u),
            parameters=_plant_file.by_label(parameters, _casadi.labels(model._p) + _casadi.labels(model._tvp)),
            units=units,
            bounds=bounds,
            equilibrium=equilibrium,
            period=period,
        )

    @classmethod
    def from_acados(
        cls: type[Kind],
        model: Any,
        *,
        parameters: Mapping[str, float] | Sequence[float] | None = None,
        units: Mapping[str, str] | None = None,
        bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
        equilibrium: tuple[ArrayLike, ArrayLike] | None = None,
        period: float | None = None,
    ) -> Kind:
        """The plant of an ``AcadosModel``, or of any object with `x`, `u`, `p` and ``f_expl_expr``, or with a
        `period` ``disc_dyn_expr``.

        Parameters
        ----------
        model
            The object. ``x_labels``, ``u_labels`` and ``name`` are taken where they are set.
        parameters
            The values of ``p``, as of `from_casadi`.
        units, bounds, equilibrium
            As of `from_casadi`.
        period
            The period of discrete dynamics, s.

        Raises
        ------
        PlantError
            The model has no explicit dynamics, or makes no plant.
        """
        formula = "f_expl_expr" if period is None else "disc_dyn_expr"
        explicit = getattr(model, formula, None)
        if explicit is None or (hasattr(explicit, "numel") and explicit.numel() == 0):
            kind = "explicit" if period is None else "discrete"
            raise PlantError(f"model: it has no {formula}; {kind} dynamics are needed")
        z = getattr(model, "z", None)
        if z is not None and hasattr(z, "numel") and z.numel():
            raise PlantError("model: it has algebraic variables z; solve for them and put them in")
        p = getattr(model, "p", None)
        return cls.from_casadi(
            model.x,
            model.u,
            explicit,
            p=None if p is None or isinstance(p, (list, tuple)) and not p else p,
            name=getattr(model, "name", None) or "acados",
            states=getattr(model, "x_labels", None),
            inputs=getattr(model, "u_labels", None),
            parameters=parameters,
            units=units,
            bounds=bounds,
            equilibrium=equilibrium,
            period=period,
        )

    @classmethod
    def from_sympy(
        cls: type[Kind],
        x: Sequence[Any],
        u: Sequence[Any],
        xdot: Any,
        *,
        y: Any = None,
        name: str = "plant",
        parameters: Mapping[Any, float] | None = None,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        units: Mapping[str, str] | None = None,
        bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
        equilibrium: tuple[ArrayLike, ArrayLike] | None = None,
        period: float | None = None,
    ) -> Kind:
        """A plant from SymPy expressions.

        Parameters
        ----------
        x, u
            The symbols (or functions of time) that are states and inputs.
        xdot
            f(x, u, p): a list or a column ``Matrix``. The last condition of a ``Piecewise`` must be True, the otherwise
            branch.
        y
            g(x, u, p), the outputs: a list or a column ``Matrix``.
        parameters
            The values of all other symbols, ``{m: 0.3}``.
        name, states, inputs, outputs, units, bounds, equilibrium, period
            As of `from_casadi`.

        Raises
        ------
        PlantError
            The expressions make no plant; the message names the place.
        """
        values = {} if parameters is None else by_name("parameters", parameters, "a dictionary of values by symbol", PlantError)
        leaves = {
            symbol: (leaf, i)
            for leaf, symbols in (("state", x), ("input", u), ("parameter", values))
            for i, symbol in enumerate(symbols)
        }
        if len(leaves) != len(x) + len(u) + len(values):
            raise PlantError("formulas: a symbol is there twice among states, inputs and parameters")
        rates, output = list(xdot), list(y) if y is not None else []
        tape = Tape()
        places = _sympy.take(tape, leaves, rates + output)
        text = _plant_file.text(
            tape,
            derivative=places[: len(rates)],
            output=places[len(rates) :],
            name=name,
            states=_plant_file.names("states", states, [_sympy.name(symbol) for symbol in x]),
            inputs=_plant_file.names("inputs", inputs, [_sympy.name(symbol) for symbol in u]),
            outputs=outputs,
            parameters=_plant_file.values(
                {_sympy.name(symbol): value for symbol, value in values.items()},
                [_sympy.name(symbol) for symbol in values],
            ),
            units=units,
            bounds=bounds,
            equilibrium=equilibrium,
            period=period,
        )
        return cls.from_json(text)

    @classmethod
    def from_matrices(
        cls: type[Kind],
        a: ArrayLike,
        b: ArrayLike,
        c: ArrayLike | None = None,
        d: ArrayLike | None = None,
        *,
        offset: ArrayLike | None = None,
        name: str = "plant",
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        units: Mapping[str, str] | None = None,
        bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
        equilibrium: tuple[ArrayLike, ArrayLike] | None = None,
        period: float | None = None,
    ) -> Kind:
        """A linear plant x_dot = A x + B u + offset, or with a `period` x+ = A x + B u + offset, and
        y = C x + D u.

        Parameters
        ----------
        a, b
            Shapes (n, n) and (n, m).
        c, d
            Shapes (k, n) and (k, m).
        offset
            Shape (n,), in state units per second, or per period.
        name, states, inputs, outputs, units, bounds, equilibrium, period
            As of `from_casadi`.

        Raises
        ------
        PlantError
            The shapes do not fit, or a number is not finite.
        """
        a_matrix, b_matrix = table("a", a, PlantError), table("b", b, PlantError)
        n = a_matrix.shape[0]
        if a_matrix.shape != (n, n) or b_matrix.shape[0] != n:
            raise PlantError(
                f"a is {_shape(a_matrix)} and b {_shape(b_matrix)}; a must be square, and b have as "
                "many rows"
            )
        m = b_matrix.shape[1]
        rest = np.zeros(n) if offset is None else column("offset", offset, n, PlantError)
        tape = Tape()
        derivative = tape.affine(a_matrix, b_matrix, rest)
        output: list[int] = []
        given = [table(of, one, PlantError) for of, one in (("c", c), ("d", d)) if one is not None]
        if given:
            rows = len(given[0])
            c_matrix = table("c", c if c is not None else np.zeros((rows, n)), PlantError)
            d_matrix = table("d", d if d is not None else np.zeros((rows, m)), PlantError)
            if c_matrix.shape != (rows, n) or d_matrix.shape != (rows, m):
                raise PlantError(
                    f"c is {_shape(c_matrix)} and d {_shape(d_matrix)}; they must be {rows} x {n} and "
                    f"{rows} x {m}"
                )
            output = tape.affine(c_matrix, d_matrix, np.zeros(rows))
        text = _plant_file.text(
            tape,
            derivative=derivative,
            output=output,
            name=name,
            states=_plant_file.names("states", states, [f"x_{i}" for i in range(n)]),
            inputs=_plant_file.names("inputs", inputs, [f"u_{i}" for i in range(m)]),
            outputs=outputs,
            parameters={},
            units=units,
            bounds=bounds,
            equilibrium=equilibrium,
            period=period,
        )
        return cls.from_json(text)


def _shape(matrix: Array) -> str:
    return " x ".join(str(size) for size in matrix.shape)
