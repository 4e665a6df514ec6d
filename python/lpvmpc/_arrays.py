"""What users give as numbers, as arrays of the right form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import is_dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SettingError

Array = NDArray[np.float64]
Kind = TypeVar("Kind")

_TOO_LARGE = "it is too large; the largest number is 1.8e308"


def numbers(place: str, given: ArrayLike, error: type[Exception] = SettingError) -> Array:
    """An array of real numbers."""
    if np.ma.is_masked(given):
        raise error(f"{place}: it has entries that are masked; every one must be a number")
    try:
        array = np.asarray(given)
        if np.iscomplexobj(array):
            raise ValueError
        return np.ascontiguousarray(array, dtype=np.float64)
    except OverflowError:
        raise error(f"{place}: {_TOO_LARGE}") from None
    except (TypeError, ValueError):
        raise error(f"{place}: {_short(given)} is no array of real numbers") from None


def _labels(given: Any) -> list[Any] | None:
    """What the entries of a Series, or the columns of a DataFrame, of pandas are called; None of anything else."""
    if not hasattr(given, "iloc"):
        return None
    labels = list(given.columns if hasattr(given, "columns") else given.index)
    return None if labels == list(range(len(labels))) else labels


def named(given: Any) -> Any:
    """A Series whose index has names as a dictionary; anything else as it is."""
    labels = _labels(given)
    if labels is None or hasattr(given, "columns") or not all(isinstance(one, str) for one in labels):
        return given
    found = dict(zip(labels, given.tolist(), strict=True))
    return found if len(found) == len(labels) else given


def ordered(
    place: str, given: Any, of: Sequence[str] | int, error: type[Exception] = SettingError
) -> Any:
    """A Series, or a DataFrame, whose entries, or columns, have names in the order of the names `of`; anything else as
    it is."""
    labels = _labels(given)
    if labels is None:
        return given
    called = ", ".join(map(str, labels[:20]))
    if isinstance(of, int):
        raise error(f"{place}: its names are {called}; it is taken by its order, so it must have none: to_numpy()")
    if len(labels) != len(of) or set(labels) != set(of):
        raise error(f"{place}: its names are {called}; they must be {', '.join(of)}")
    return given[list(of)]


def number(place: str, given: Any, error: type[Exception] = SettingError) -> float:
    """A number."""
    try:
        return float(given)
    except OverflowError:
        raise error(f"{place}: {_TOO_LARGE}") from None
    except (TypeError, ValueError):
        raise error(f"{place}: it is {given!r}; it must be a number") from None


def numbers_or_none(given: Mapping[str, Any]) -> dict[str, float | None]:
    """Numbers by name, each of which may be left out."""
    return {name: None if one is None else number(name, one) for name, one in given.items()}


def whole(name: str, given: Any, least: int = 1, most: int = 2**31) -> int:
    """A whole number."""
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool) and least <= given <= most:
        return int(given)
    raise SettingError(f"{name}: it is {given!r}; it must be a whole number from {least} to {most}")


def listed(place: str, given: Any, what: str) -> list[Any]:
    """A list, of anything but numbers; `what` it must be is for the message."""
    if isinstance(given, (list, tuple)):
        return list(given)
    raise SettingError(f"{place}: {given!r} is not {what}")


def by_name(
    place: str, given: Any, what: str, error: type[Exception] = SettingError
) -> Mapping[Any, Any]:
    """A dictionary, as a rule with names as its keys; `what` it must be is for the message."""
    if isinstance(given, Mapping):
        return given
    raise error(f"{place}: {given!r} is not {what}")


def instance(place: str, given: Any, kind: type[Kind], name: str | None = None) -> Kind:
    """Something of this package's own; `name` is where it is found, if not in `lpvmpc` itself."""
    if isinstance(given, kind):
        return given
    raise SettingError(f"{place}: {type(given).__name__} is no {name or f'lpvmpc.{kind.__name__}'}")


def _size(of: Sequence[str] | int) -> int:
    return of if isinstance(of, int) else len(of)


def column(
    place: str, given: ArrayLike, of: Sequence[str] | int, error: type[Exception] = SettingError
) -> Array:
    """A vector with a number for each name, or of so many; a column or a row of a matrix is one, too."""
    array, size = numbers(place, ordered(place, given, of, error), error), _size(of)
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.shape != (size,) and not (array.ndim == 0 and size == 1):
        raise error(f"{place}: its shape is {array.shape}; it must be ({size},)")
    return array.reshape(size)


def table(place: str, given: ArrayLike, error: type[Exception] = SettingError) -> Array:
    """A matrix of finite numbers."""
    array = numbers(place, given, error)
    if array.ndim != 2:
        raise error(f"{place}: it has {array.ndim} dimensions; it must have 2")
    return finite(place, array, error)


def finite(place: str, array: Array, error: type[Exception] = SettingError) -> Array:
    """The array, all of whose entries are finite."""
    if not np.isfinite(array).all():
        raise error(f"{place}: it has an entry that is not finite")
    return array


def _both_ordered(place: str, given: Any, rows: Sequence[str], columns: Sequence[str]) -> Any:
    """A matrix, rows and columns in the order of their names, or its diagonal."""
    found = ordered(place, given, columns)
    return ordered(place, found.T, rows).T if hasattr(found, "columns") else found


def weight(place: str, given: ArrayLike, names: Sequence[str]) -> Array:
    """A weight matrix: given whole, or by its diagonal."""
    array, size = numbers(place, _both_ordered(place, given, names, names)), len(names)
    if array.ndim == 0 and size == 1:
        array = array.reshape(1)
    if array.shape == (size,):
        return np.diag(array)
    if array.shape == (size, size):
        return array
    raise SettingError(
        f"{place}: its shape is {array.shape}; it must be ({size},), the diagonal, or ({size}, {size})"
    )


def by_stage(place: str, given: ArrayLike, of: Sequence[str] | int) -> Array:
    """A vector for each stage as rows; one vector is a single row."""
    array, size = numbers(place, ordered(place, given, of)), _size(of)
    if array.ndim == 0 and size == 1:
        array = array.reshape(1)
    if array.shape == (size,):
        return array.reshape(1, size)
    if array.ndim == 2 and array.shape[1] == size and array.shape[0] > 0:
        return array
    raise SettingError(
        f"{place}: its shape is {array.shape}; it must be ({size},), or (stages, {size})"
    )


def weights_by_stage(place: str, given: ArrayLike, names: Sequence[str]) -> Array:
    """A weight matrix for each stage; one, or the diagonal of one, is a single stage."""
    return matrices_by_stage(place, given, names, names)


def matrices_by_stage(place: str, given: ArrayLike, rows: Sequence[str], columns: Sequence[str]) -> Array:
    """A matrix for each stage, whose rows and columns have these names; one matrix, or the diagonal of one, is a single
    stage."""
    array, shape = numbers(place, _both_ordered(place, given, rows, columns)), (len(rows), len(columns))
    if shape[0] == shape[1] and array.shape == (shape[0],):
        array = np.diag(array)
    if array.shape == shape:
        return array.reshape(1, *shape)
    if array.ndim == 3 and array.shape[1:] == shape and array.shape[0] > 0:
        return array
    raise SettingError(
        f"{place}: its shape is {array.shape}; it must be {shape}, or (stages, {shape[0]}, {shape[1]})"
    )


def copied(given: Any) -> Any:
    """The same with arrays, lists and dictionaries of its own: what a user changes later changes nothing here."""
    if isinstance(given, Mapping):
        return {key: copied(value) for key, value in given.items()}
    if isinstance(given, list):
        return [copied(value) for value in given]
    if isinstance(given, tuple):  # of named ones, too, the values
        return tuple(copied(value) for value in given)
    if isinstance(given, np.ndarray) or is_dataclass(given) or hasattr(given, "iloc"):
        return deepcopy(given)
    return given


def equally_long(*lists: Array) -> list[Array]:
    """Lists by stage, the last entry of the shorter ones repeated."""
    stages = max(len(one) for one in lists)

    def extended(array: Array) -> Array:
        missing = stages - len(array)
        return np.concatenate([array, np.repeat(array[-1:], missing, axis=0)]) if missing else array

    return [extended(one) for one in lists]


def _short(given: Any) -> str:
    text = repr(given)
    return text if len(text) <= 60 else text[:57] + "..."
