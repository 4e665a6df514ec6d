"""Terminal sets of a ballbot, proved."""

from __future__ import annotations

from os import PathLike, fspath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _lpvmpc
from .._arrays import instance, numbers, numbers_or_none, whole
from .._progress import reported
from ..errors import SettingError
from .._files import save
from .scenario import Scenario

Array = NDArray[np.float64]


class ProvedSet:
    """A law u = -K x, a cost x'Px and the set x'Px <= level of a ballbot, with what was proved of them.

    For the model with exactly the certificate's parameters, the exact state and no delay: under the law, held over each
    sample, the cost of every state in the set decreases per sample by the stage cost and `contraction` of itself, and
    all limits hold, those of the states between the samples, too.
    """

    def __init__(self, numbers: dict[str, Any], text: str) -> None:
        self._numbers = numbers
        self._text = text

    def to_json(self) -> str:
        """The text of the certificate's file."""
        return self._text

    def save(self, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Writes the certificate: for ``controller.terminal.certified.certificate`` of a scenario, `verify` and
        ``ballbot verify``.

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

    @property
    def k(self) -> Array:
        """K, N m per rad and per rad/s, shape (4,)."""
        return np.array(self._numbers["k"])

    @property
    def p(self) -> Array:
        """P, shape (4, 4)."""
        return np.array(self._numbers["p"])

    @property
    def level(self) -> float:
        """The set is x'Px <= level."""
        return float(self._numbers["level"])

    @property
    def t_s(self) -> float:
        """Sampling time, s."""
        return float(self._numbers["t_s"])

    @property
    def contraction(self) -> float:
        """What the cost decreases by per sample beyond the stage cost, as a part of itself, at least."""
        return float(self._numbers["contraction"])

    @property
    def largest_states(self) -> Array:
        """The largest |x_i| in the set, rad and rad/s, shape (4,)."""
        return np.array(self._numbers["largest_states_at_samples"])

    @property
    def reach(self) -> Array:
        """What no |x_i| reaches between the samples, rad and rad/s, shape (4,)."""
        return np.array(self._numbers["largest_states_between_samples"])

    @property
    def boxes(self) -> int:
        """Boxes of states in the proof."""
        return int(self._numbers["boxes"])

    def contains(self, x: ArrayLike) -> Any:
        """Whether a state, shape (4,), is in the set, or each row of states, (count, 4)."""
        states = numbers("x", x)
        if states.ndim not in (1, 2) or states.shape[-1] != 4:
            raise SettingError(f"x: its shape is {states.shape}; it must be (4,) or (count, 4)")
        inside = np.einsum("...i,ij,...j->...", states, self.p, states) <= self.level
        return bool(inside) if inside.ndim == 0 else inside

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ProvedSet) and self._text == other._text

    def __hash__(self) -> int:
        return hash(self._text)

    def __repr__(self) -> str:
        largest = ", ".join(f"{one:.4g}" for one in self.largest_states)
        return f"<ProvedSet: level {self.level:.6g}, |x| <= [{largest}], {self.boxes} boxes>"


def certify(
    scenario: Scenario,
    *,
    size: float | None = None,
    level: float | None = None,
    contraction: float | None = None,
    boxes: int | None = None,
    trials: int | None = None,
    progress: bool = False,
) -> ProvedSet:
    """Finds the largest terminal set of a scenario's robot, weights and bounds that it can prove: as ``ballbot
    certify``. Minutes; seconds with a small `size`.

    Parameters
    ----------
    scenario
        Robot, sampling time, weights and bounds.
    size
        The share of the bounds of tilt and tilt rate that the set may use; without, it is searched for.
    level
        Level of the designed set, in units of the cost.
    contraction
        Share of the cost by which the design decreases it beyond the stage cost; more makes the proof shorter and P
        larger.
    boxes
        Most boxes of states in one proof.
    trials
        Higher levels that are tried after the design; 0 keeps the level.
    progress
        Whether to show a progress bar (needs tqdm).

    Raises
    ------
    ScenarioError
        The scenario makes no sense.
    CertificateError
        What is asked makes none, or no set could be proved.
    SettingError
        Something that was asked is no number.
    """
    of_numbers = {"size": size, "level": level, "contraction": contraction}
    asked: dict[str, Any] = {**numbers_or_none(of_numbers)}
    asked["boxes"] = None if boxes is None else whole("boxes", boxes, least=0)
    asked["trials"] = None if trials is None else whole("trials", trials, least=0)
    instance("scenario", scenario, Scenario, "lpvmpc.ballbot.Scenario")
    with reported(progress) as report:
        return ProvedSet(*_lpvmpc.certify_scenario(scenario._native, asked, report))


def verify(
    certificate: str | PathLike[str] | ProvedSet, *, progress: bool = False
) -> ProvedSet:
    """Proves every claim of a certificate again from its numbers, without an optimiser: as ``ballbot verify``. Minutes
    for a large set.

    Parameters
    ----------
    certificate
        The path of its file; or one that was found.
    progress
        Whether to show a progress bar (needs tqdm).

    Raises
    ------
    OSError
        The file cannot be read.
    FalseClaimError
        A claim is false: the message names it and a state that shows it.
    CertificateError
        It is no certificate, was changed after it was written, or a claim could not be shown.
    """
    if isinstance(certificate, ProvedSet):
        text = certificate.to_json()
    else:
        text = _lpvmpc.read_certificate(fspath(certificate))
    with reported(progress) as report:
        return ProvedSet(_lpvmpc.verify_certificate(text, report), text)
