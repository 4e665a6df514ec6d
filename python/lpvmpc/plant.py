"""Plants: x_dot = f(x, u, p), or x+ = f(x, u, p), with names, units, bounds and parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lpvmpc
from ._arrays import column, number
from ._files import save
from ._sources import Embedding as Embedding
from ._sources import PlantSources
from .errors import PlantError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Signal:
    """A state, an input or an output."""

    name: str
    unit: str = ""
    lower: float | None = None
    """The least value that it may have; none without."""
    upper: float | None = None
    """The largest value that it may have; none without."""


def names_of(signals: Sequence[Signal]) -> list[str]:
    """What they are called."""
    return [one.name for one in signals]


@dataclass(frozen=True, eq=False)
class SteadyState:
    """Where a plant stands: f(x, u) = 0, or in discrete time f(x, u) = x."""

    x: Array
    """The state, shape (n,)."""
    u: Array
    """The input that holds it there, shape (m,)."""
    reached: bool
    """Whether x is the reference itself, to 1e-4 of its size. If not, it is the nearest state at which the
    plant can stand."""


class Plant(PlantSources):
    """A plant x_dot = f(x, u, p), or in discrete time x+ = f(x, u, p), perhaps with outputs y = g(x, u, p).

    Make one by `from_casadi`, `from_do_mpc`, `from_acados`, `from_sympy`, `from_matrices`, `load` or
    `from_json`. A plant does not change: `with_parameters` makes another one. It can be pickled.
    """

    # What a plant is.

    @property
    def name(self) -> str:
        """What it is called."""
        return self._native.name

    @property
    def states(self) -> list[Signal]:
        """The states, in the order of x."""
        return [Signal(*one) for one in self._native.states]

    @property
    def inputs(self) -> list[Signal]:
        """The inputs, in the order of u."""
        return [Signal(*one) for one in self._native.inputs]

    @property
    def outputs(self) -> list[Signal]:
        """The outputs, in the order of y."""
        return [Signal(*one) for one in self._native.outputs]

    @property
    def parameters(self) -> dict[str, float]:
        """The values of the parameters by name, in the order of p."""
        return {name: value for name, _, value in self._native.parameters}

    @property
    def equilibrium(self) -> tuple[Array, Array] | None:
        """The steady state (x, u): the one that was given, where the plant stands there with its parameters. With others
        it is that state under the input which holds it, or, where none does, the state and input near both; None where the
        plant stands nowhere near it within its bounds."""
        found = self._native.equilibrium
        return None if found is None else (np.array(found[0]), np.array(found[1]))

    @property
    def period(self) -> float | None:
        """The period of a plant in discrete time, s; None in continuous time."""
        return self._native.period

    def with_parameters(self, **values: float) -> Plant:
        """This plant with other values of some parameters. Its `equilibrium` goes along with them.

        Raises
        ------
        PlantError
            There is no such parameter, or a value is not finite.
        """
        known = [(name, number(f"parameters, {name}", value, PlantError)) for name, value in values.items()]
        return Plant(self._native.with_parameters(known))

    # What it does.

    def f(self, x: ArrayLike, u: ArrayLike) -> Array:
        """f(x, u), shape (n,): x_dot in state units per second, or in discrete time the state one period later.

        Raises
        ------
        PlantError
            `x` is not of shape (n,), or `u` not of shape (m,).
        """
        return self._native.f(*self._point(x, u))

    def g(self, x: ArrayLike, u: ArrayLike) -> Array:
        """y = g(x, u), shape (k,), in the units of the outputs.

        Raises
        ------
        PlantError
            `x` is not of shape (n,), or `u` not of shape (m,).
        """
        return self._native.g(*self._point(x, u))

    def jacobian(self, x: ArrayLike, u: ArrayLike) -> tuple[Array, Array]:
        """The derivatives of f, (df/dx, df/du), shapes (n, n) and (n, m).

        Raises
        ------
        PlantError
            `x` is not of shape (n,), or `u` not of shape (m,).
        """
        return self._native.jacobian(*self._point(x, u))

    def steady_state(self, x_ref: ArrayLike, weights: ArrayLike | None = None) -> SteadyState:
        """The steady state within the plant's bounds that is nearest to a reference.

        Parameters
        ----------
        x_ref
            The reference, shape (n,).
        weights
            What a distance in each state counts, shape (n,); one without. A state of weight zero is
            wherever the others want it (it counts a millionth of the dearest).

        Raises
        ------
        SettingError
            None was found: there is none within the bounds, or none is near where the search from the
            reference ended.

        Examples
        --------
        >>> tank = Plant.from_matrices([[-0.1]], [[1]], states=["level"], inputs=["inflow"])
        >>> tank.steady_state([2.0]).u.round(6).tolist()
        [0.2]
        """
        states = names_of(self.states)
        weight = np.ones(len(states)) if weights is None else column("weights", weights, states)
        return SteadyState(*self._native.steady_state(column("x_ref", x_ref, states), weight))

    def _point(self, x: ArrayLike, u: ArrayLike) -> tuple[Array, Array]:
        return (
            column("x", x, names_of(self.states), PlantError),
            column("u", u, names_of(self.inputs), PlantError),
        )

    # Where it goes.

    def to_json(self) -> str:
        """The text of its file, which is read as the same plant to the last bit, with its parameters and its equilibrium as
        they are now."""
        return self._native.to_json()

    def save(self, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Writes its file.

        Parameters
        ----------
        path
            The file.
        overwrite
            Whether a file that is there is replaced.

        Raises
        ------
        FileExistsError
            The file is there and is not to be replaced.
        OSError
            The file cannot be written.
        """
        save(self.to_json(), path, overwrite)

    def to_rust(self) -> str:
        """The plant as a module of Rust, for `f32` and `f64`, without std and heap, with its parameters as they
        are now: for the crate `lpvmpc` on a microcontroller."""
        return self._native.to_rust()

    def __getstate__(self) -> tuple[str, dict[str, float]]:
        return self._native.made_from(), self.parameters

    def __setstate__(self, state: tuple[str, dict[str, float]]) -> None:
        text, parameters = state
        native = _lpvmpc.Plant.from_json(text)
        self._native = native.with_parameters(list(parameters.items()))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Plant) and self._native == other._native

    def __hash__(self) -> int:
        return hash((self.to_json(), tuple(self.parameters.items())))

    def __repr__(self) -> str:
        def listed(signals: list[Signal]) -> str:
            return ", ".join(f"{s.name} [{s.unit}]" if s.unit else s.name for s in signals)

        return f"<Plant {self.name!r}: states {listed(self.states)}; inputs {listed(self.inputs)}>"
