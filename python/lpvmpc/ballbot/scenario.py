"""Scenarios of a ballbot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, MutableMapping
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from .. import _lpvmpc
from .._progress import reported
from .._files import save
from ._values import plain
from .run import Run


def builtin_names() -> list[str]:
    """The names of the built-in scenarios.

    Examples
    --------
    >>> from lpvmpc import ballbot
    >>> ballbot.builtin_names()[:2]
    ['two-setpoints', 'two-setpoints-linear']
    """
    return _lpvmpc.Scenario.builtins()


class Table(MutableMapping[str, Any]):
    """A table of a scenario, whose keys are read and changed in place: as items, ``table["t_s"]``, or as attributes,
    ``table.t_s``.

    A key may lead through tables and places in lists, with dots between: ``table["bounds.torque_nm.1"]``. What is read
    is what is given, or the default; tables are read as such, lists as tuples. Every change is checked at once; what a
    value means is checked when the scenario is run.

    Raises
    ------
    KeyError, AttributeError
        There is nothing at a key that is read.
    ScenarioError
        A change makes no scenario: the key is none, or its value has the wrong type. Nothing is changed then.
    """

    def __init__(self, native: _lpvmpc.Scenario, key: str) -> None:
        object.__setattr__(self, "_native", native)
        object.__setattr__(self, "_key", key)

    _native: _lpvmpc.Scenario
    _key: str

    def to_dict(self) -> dict[str, Any]:
        """The table as a dictionary of its own, with every default."""
        found: dict[str, Any] = self._native.value(self._key)
        return found

    def update(self, *changes: Any, **more: Any) -> None:
        """Changes several keys at once: all, or on an error none.

        Parameters
        ----------
        changes, more
            Values by key, as for a dictionary.
        """
        self._set(dict(*changes, **more))

    def _set(self, changes: Mapping[str, Any]) -> None:
        self._native.set([(self._place(key), plain(value)) for key, value in changes.items()])

    def _place(self, key: str) -> str:
        return f"{self._key}.{key}" if self._key else str(key)

    def _shown(self, place: str, value: Any) -> Any:
        if isinstance(value, dict):
            return Table(self._native, place)
        if isinstance(value, list):
            return tuple(self._shown(f"{place}.{i}", entry) for i, entry in enumerate(value))
        return value

    def __getitem__(self, key: str) -> Any:
        place = self._place(key)
        value = self._native.value(place) if key else None
        if value is None:
            raise KeyError(place)
        return self._shown(place, value)

    def __setitem__(self, key: str, value: Any) -> None:
        self._set({key: value})

    def __delitem__(self, key: str) -> None:
        self._native.remove(self._place(key))

    def __iter__(self) -> Iterator[str]:
        return iter(self.to_dict())

    def __len__(self) -> int:
        return len(self.to_dict())

    def __getattr__(self, name: str) -> Any:
        # Private names are asked for by other libraries, and are never keys.
        if not name.startswith("_"):
            try:
                return self[name]
            except KeyError:
                keys = ", ".join(self)
                message = f"there is no key {self._place(name)!r}; there are {keys}"
                raise AttributeError(message) from None
        raise AttributeError(name)

    def __setattr__(self, name: str, value: Any) -> None:
        self[name] = value

    def __delattr__(self, name: str) -> None:
        del self[name]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self]

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Table):
            return self.to_dict() == other.to_dict()
        return isinstance(other, Mapping) and self.to_dict() == plain(other)

    def __repr__(self) -> str:
        return f"<Table {self._key!r}: {self.to_dict()}>"


class Scenario(Table):
    """A robot, its controller, its reference and its world: what the program ``ballbot`` reads from a scenario file.

    All keys can be read and changed in place, as those of a `Table`; the project's ``docs`` and ``ballbot scenario
    show`` have them all.

    Parameters
    ----------
    content
        The text of a scenario file (TOML), or its keys and values.
    folder
        Where the files are that it names.

    Raises
    ------
    ScenarioError
        It is no scenario; with line and column, and for a key that is none the nearest right one.

    Examples
    --------
    >>> from lpvmpc import ballbot
    >>> scenario = ballbot.Scenario.builtin("two-setpoints")
    >>> scenario.controller.horizon = 30
    >>> scenario["bounds.torque_nm.1"] = 1.0
    >>> scenario.bounds.torque_nm
    (-1.5, 1.0)
    """

    def __init__(
        self, content: str | Mapping[str, Any], folder: str | PathLike[str] = "."
    ) -> None:
        native = _lpvmpc.Scenario.parse(plain(content), "the scenario", fspath(folder))
        super().__init__(native, "")

    @classmethod
    def _of(cls, native: _lpvmpc.Scenario) -> Scenario:
        scenario = cls.__new__(cls)
        Table.__init__(scenario, native, "")
        return scenario

    @classmethod
    def builtin(cls, name: str) -> Scenario:
        """A built-in scenario.

        Parameters
        ----------
        name
            One of `builtin_names`.

        Raises
        ------
        ScenarioError
            There is none of this name.
        """
        return cls._of(_lpvmpc.Scenario.builtin(name))

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Scenario:
        """The scenario in a file, or a built-in one by its name.

        Parameters
        ----------
        path
            A TOML file. Files that it names are looked for beside it.

        Raises
        ------
        ScenarioError
            The file cannot be read, or is no scenario.
        """
        return cls._of(_lpvmpc.Scenario.load(fspath(path)))

    @property
    def folder(self) -> Path:
        """Where the files are that it names."""
        return Path(self._native.folder)

    def to_toml(self) -> str:
        """The text of its file: as it was read, with comments; once changed, with every default and without."""
        return self._native.text

    def save(self, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Writes its file, for the program ``ballbot`` and for `load`.

        Parameters
        ----------
        path
            The file. Where the scenario names files, it belongs into their `folder`.
        overwrite
            Whether a file that is there is replaced.

        Raises
        ------
        FileExistsError
            The file is there and is not to be replaced.
        OSError
            The file cannot be written.
        """
        save(self.to_toml(), path, overwrite)

    def copy(self) -> Scenario:
        """One of its own with the same keys."""
        return self._of(self._native.copy())

    def check(self, progress: bool = False) -> None:
        """Checks what all values mean, and proves a certificate that it relies on (minutes, the first time).

        Parameters
        ----------
        progress
            Whether to show a progress bar (needs tqdm).

        Raises
        ------
        ScenarioError
            A value makes no sense; the message names its key and what would be right.
        """
        with reported(progress) as report:
            self._native.check(report)

    def simulate(self, progress: bool = False) -> Run:
        """Runs the closed loop: as ``ballbot simulate``, with the same numbers.

        Parameters
        ----------
        progress
            Whether to show a progress bar (needs tqdm).

        Returns
        -------
        Run
            What happened; `Run.ended_early` says why, where it did not come to its end.

        Raises
        ------
        ScenarioError
            A value makes no sense; the message names its key and what would be right.
        """
        with reported(progress) as report:
            return Run._of(self._native.simulate(report))

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        native = self._native
        return _restored, (native.text, native.origin, fspath(native.folder))

    def __repr__(self) -> str:
        return f"<Scenario {self['title']!r}>"


def _restored(text: str, origin: str, folder: str) -> Scenario:
    return Scenario._of(_lpvmpc.Scenario.parse(text, origin, folder))
