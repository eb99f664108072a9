"""Tells the packages above that a property has changed.

Blender wants the functions that set and update a property where the property is defined. What they do needs meshes,
the live session and the list of models, which are defined above the properties. So `registration` sets a
`PropertyListener`, and the properties call it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol


class PropertyListener(Protocol):
    """What follows from changes of properties; `settings` is always a `WKSSegmentSettings`."""

    def labels_outdated(self, settings: Any) -> None:
        """A setting that labels follow has changed."""

    def model_chosen(self, settings: Any) -> None:
        """Another row of the list of models has become active."""

    def model_renamed(self, settings: Any, row: Any) -> None:
        """A row of the list of models has another name."""

    def outputs_changed(self, settings: Any) -> None:
        """Something else is to be written of segments."""

    def palette_chosen(self, settings: Any) -> None:
        """The user has chosen another palette."""

    def rename_part(self, settings: Any, labels: str, part: int, name: str) -> None:
        """The user has typed another name for a part."""

    def recolor_part(self, settings: Any, labels: str, part: int, color: tuple[float, float, float]) -> None:
        """The user has chosen another color for a part."""

    def bone_number_changed(self, settings: Any) -> None:
        """The user asks for another number of parts from bones."""

    def bones_chosen(self, settings: Any) -> None:
        """The user has chosen a bone as a part, or let it join another."""


_connected: list[PropertyListener] = []


def set_listener(new: PropertyListener) -> None:
    """Let the properties call this listener only."""
    _connected[:] = [new]


def remove_listener() -> None:
    """Forget the listener."""
    _connected.clear()


def listener() -> PropertyListener:
    """The connected listener; the extension connects one before it registers the properties."""
    return _connected[0]


@contextmanager
def unheard() -> Iterator[None]:
    """Tell nobody about changes in the block: values are set again that the listener knows already."""
    before = list(_connected)
    _connected[:] = [_Deaf()]
    try:
        yield
    finally:
        _connected[:] = before


class _Deaf:
    """A listener that does nothing."""

    def labels_outdated(self, settings: Any) -> None:
        """Nothing."""

    def model_chosen(self, settings: Any) -> None:
        """Nothing."""

    def model_renamed(self, settings: Any, row: Any) -> None:
        """Nothing."""

    def outputs_changed(self, settings: Any) -> None:
        """Nothing."""

    def palette_chosen(self, settings: Any) -> None:
        """Nothing."""

    def rename_part(self, settings: Any, labels: str, part: int, name: str) -> None:
        """Nothing."""

    def recolor_part(self, settings: Any, labels: str, part: int, color: tuple[float, float, float]) -> None:
        """Nothing."""

    def bone_number_changed(self, settings: Any) -> None:
        """Nothing."""

    def bones_chosen(self, settings: Any) -> None:
        """Nothing."""
