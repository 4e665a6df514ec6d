"""Certificates of terminal sets."""

from __future__ import annotations

import json
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lpvmpc
from ._arrays import column, numbers, ordered
from ._files import read, save
from .errors import SettingError

Array = NDArray[np.float64]


class Certificate:
    """A law u = u_eq - K (x - x_eq), a cost and a set about an equilibrium, with what is claimed of them for the
    sampled nonlinear plant: what `certify` proves and `verify` proves again.

    With e = x - x_eq, v = u - u_eq and V(e) = e'Pe, for every state with V(e) <= level, under the law, held over each sample:
    V(e+) <= (1 - contraction) V(e) - e'Qe - v'Rv, |e| <= state_limits at and between the samples, and |v| <= input_limits. The
    equilibrium is exact, f(x_eq, u_eq) = 0 (in discrete time x_eq, and there is nothing between the samples), and within
    `within` of the numbers here. The plant is the model, with exactly
    its parameters; the state is exact, and there is no delay.
    """

    def __init__(self, text: str) -> None:
        _lpvmpc.check_certificate(text)
        self._text = text
        self._content: dict[str, Any] = json.loads(text)["certificate"]

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Certificate:
        """The certificate in a file. **Nothing is proved**: that is for `verify`.

        Raises
        ------
        OSError
            The file cannot be read, or is no text.
        CertificateError
            It is no certificate, or was changed after it was written.
        """
        return cls(read(path))

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
        save(self._text, path, overwrite)

    def to_json(self) -> str:
        """The text of its file."""
        return self._text

    @property
    def k(self) -> Array:
        """K, shape (m, n)."""
        return self._array("k")

    @property
    def p(self) -> Array:
        """P, shape (n, n)."""
        return self._array("p")

    @property
    def level(self) -> float:
        """The set is (x - x_eq)'P (x - x_eq) <= level."""
        return float(self._content["level"])

    @property
    def x(self) -> Array:
        """x_eq, shape (n,)."""
        return np.array(self._content["equilibrium"]["x"], dtype=np.float64)

    @property
    def u(self) -> Array:
        """u_eq, shape (m,)."""
        return np.array(self._content["equilibrium"]["u"], dtype=np.float64)

    @property
    def within(self) -> Array:
        """How far the exact equilibrium is from these numbers, at most: of each state, then of each input."""
        return np.array(self._content["equilibrium"]["within"], dtype=np.float64)

    @property
    def t_s(self) -> float:
        """Sampling time, s; of a plant in discrete time its period."""
        return float(self._content["t_s"])

    @property
    def q(self) -> Array:
        """Q of the stage cost, shape (n, n)."""
        return self._array("q")

    @property
    def r(self) -> Array:
        """R of the stage cost, shape (m, m)."""
        return self._array("r")

    @property
    def contraction(self) -> float:
        """The share of the cost by which it falls beyond the stage cost, at least."""
        return float(self._content["contraction"])

    @property
    def state_limits(self) -> Array:
        """|x - x_eq| in the set, at and between the samples, at most, shape (n,); infinite for no limit."""
        return self._limits("state_limits")

    @property
    def input_limits(self) -> Array:
        """|u - u_eq| in the set, at most, shape (m,); infinite for no limit."""
        return self._limits("input_limits")

    @property
    def plant(self) -> str:
        """The name of the plant."""
        return str(self._content["plant"]["name"])

    @property
    def boxes(self) -> int:
        """On how many boxes of states the decrease was proved when the certificate was made; for information."""
        return int(self._content["record"]["boxes"])

    def value(self, x: ArrayLike) -> Array:
        """(x - x_eq)'P (x - x_eq) of a state, shape (n,), or of each row of states, (count, n).

        A certificate knows no names: Series and DataFrames with names are refused.
        """
        n = len(self.x)
        states = numbers("x", ordered("x", x, n))
        if states.ndim not in (1, 2) or states.shape[-1] != n:
            raise SettingError(f"x: its shape is {states.shape}; it must be ({n},) or (count, {n})")
        e = states - self.x
        found: Array = np.asarray(np.einsum("...i,ij,...j->...", e, self.p, e))
        return found

    def contains(self, x: ArrayLike) -> Any:
        """Whether a state, shape (n,), is in the set, or each row of states, (count, n); without names, as in `value`."""
        inside = self.value(x) <= self.level
        return bool(inside) if inside.ndim == 0 else inside

    def __call__(self, t: float, x: ArrayLike) -> Array:
        """The law at the state `x`: as a controller of `simulate`, which tells the time `t`, too."""
        found: Array = self.u - self.k @ (column("x", x, len(self.x)) - self.x)
        return found

    def _array(self, name: str) -> Array:
        return np.array(self._content[name], dtype=np.float64)

    def _limits(self, name: str) -> Array:
        return np.array([np.inf if one is None else one for one in self._content[name]])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Certificate) and self._content == other._content

    def __hash__(self) -> int:
        return hash(self._text)

    def __reduce__(self) -> tuple[type[Certificate], tuple[str]]:
        return Certificate, (self._text,)

    def __repr__(self) -> str:
        reach = ", ".join(f"{one:.4g}" for one in self.state_limits)
        return (
            f"<Certificate of {self.plant!r}, {self.t_s} s: level {self.level:.6g}, "
            f"|x - x_eq| <= [{reach}], {self.boxes} boxes>"
        )
