"""Checks of arguments that are lists of poses."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from ..message import Message

Item = TypeVar("Item")


def as_list(values: Iterable[Item], name: str) -> list[Item]:
    """The values of an argument as a list, so that a generator may be passed.

    Raises
    ------
    TypeError
        If it is a single value, such as a mesh; the message names the argument.
    """
    if not isinstance(values, Iterable):
        template = "{name} must be a list, not a single {type}: put it in square brackets"
        raise TypeError(Message(template, name=name, type=type(values).__name__))
    return list(values)
