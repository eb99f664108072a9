"""Errors whose message is for the user."""

from __future__ import annotations

from ..core.message import Message


class UserError(Exception):
    """A problem that the user can solve; the message names what is wrong and says what to do.

    Parameters
    ----------
    template : str
        The message, or with values a template for it: see `Message`.
    """

    def __init__(self, template: str, **values: object) -> None:
        super().__init__(Message(template, **values))


class TooLargeError(UserError):
    """A job needs more time or memory than the user allows; the message gives the estimate."""


class OtherFacesError(UserError):
    """A character has other faces in a pose than its mesh, or than in its other poses; the message names the pose."""


class ChangedError(UserError):
    """The scene has changed since it was read; the message says how."""


class EndedError(UserError):
    """A job was ended before it was complete; the message says why."""
