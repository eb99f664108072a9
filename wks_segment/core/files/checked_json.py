"""JSON of strangers, whose values are checked before they are used, and are never printed as they are."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Mapping
from hashlib import blake2b
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..message import Message, message_of

MOST_NUMBER = 1e6
"""Upper bound of numbers in a file, whose squares bound variances: beyond, single precision would overflow."""
MOST_LISTS, MOST_VALUES = 100_000, 2_500_000
"""Upper bounds of lists and objects in a text, and of its values: small ones take twenty times their text in memory."""
LONGEST_QUOTE = 60
"""Maximum length of what a message quotes from a file."""
POSITIVE, BELOW_ONE = float(np.nextafter(0.0, 1.0)), float(np.nextafter(1.0, 0.0))
_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxlist, _SHORT.maxdict = 2, 3, 2
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = LONGEST_QUOTE


class DamagedError(ValueError):
    """A value of a file is not what it must be; the message says which."""


class Field(NamedTuple):
    """An array of a file: name, shape, bounds of its numbers, and whether they are whole."""

    name: str
    shape: tuple[int, ...]
    least: float = -MOST_NUMBER
    most: float = MOST_NUMBER
    whole: bool = False


def parsed(text: str) -> Any:
    """The value in JSON text; DamagedError if it is not JSON, or would take much more memory than its text."""
    if text.count("[") + text.count("{") > MOST_LISTS or text.count(",") > MOST_VALUES:
        raise DamagedError("it has too many values")
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DamagedError(message_of(error)) from error


def quoted(value: object) -> str:
    """A value of a file for a message: on one line, short, and without letters that a terminal would obey."""
    text = _SHORT.repr(value)
    return text if len(text) <= LONGEST_QUOTE else f"{text[: LONGEST_QUOTE - 1]}…"


def length(content: dict[str, Any], name: str, most: int) -> int:
    """Length of a list in a file, from 1 to a maximum."""
    numbers = content.get(name)
    if not isinstance(numbers, list) or len(numbers) > most:
        raise DamagedError(Message("{name} is missing, or has too many numbers", name=name))
    if not numbers:
        raise DamagedError(Message("{name} is empty", name=name))
    return len(numbers)


def read_array(content: dict[str, Any], field: Field) -> NDArray[np.float64]:
    """An array of a file, checked against its field."""
    name = field.name
    array = _numbers(content.get(name), name, len(field.shape))
    if array.shape != field.shape:
        raise DamagedError(
            Message("{name} has the shape {shape}, not {expected}", name=name, shape=array.shape, expected=field.shape)
        )
    if not np.isfinite(array).all():
        raise DamagedError(Message("{name} has a number that is not finite", name=name))
    outside = array[(array < field.least) | (array > field.most) | (field.whole & (array % 1 != 0))]
    if not outside.size:
        return array
    value = float(outside[0])
    if field.whole:
        raise DamagedError(
            Message("{name} has the number {value:g}, which is not a whole number from {least:g} to {most:g}",
                    name=name, value=value, least=field.least, most=field.most)
        )  # fmt: skip
    if field.least > 0 and value < field.least:
        raise DamagedError(Message("{name} has a number that is not positive, or far too small", name=name))
    if field.least <= 0 and value < field.least:
        raise DamagedError(Message("{name} has a negative number", name=name))
    raise DamagedError(Message("{name} has a number of {value:.3g}, too large", name=name, value=value))


def digest_of(description: str, arrays: Mapping[str, NDArray[Any]]) -> str:
    """Digest of named arrays, as numbers whatever their type, and of a description."""
    digest = blake2b(description.encode(), digest_size=16)
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name], dtype=np.float64)
        digest.update(repr((name, array.shape)).encode())
        digest.update(array.data)
    return digest.hexdigest()


def _numbers(value: Any, name: str, depth: int) -> NDArray[np.float64]:
    """An array of nested lists of numbers. Neither truth values nor texts are numbers, as NumPy has them."""
    inner = [value]
    try:
        for _ in range(depth):
            if {type(each) for each in inner} - {list}:
                raise TypeError
            inner = [each for part in inner for each in part]
        if {type(each) for each in inner} - {int, float}:
            raise TypeError
        return np.array(value, dtype=np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        raise DamagedError(Message("{name} is missing or not numbers", name=name)) from error
