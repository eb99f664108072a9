"""Texts for people that can be shown in another language.

The core knows no language but English, threads must not ask Blender for a translation, and what the command line
prints is read by programs. So a message is made in English where it is raised, and keeps its template and its values:
whoever shows it looks the template up and fills it in again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from numbers import Integral, Real
from typing import Any


class Message(str):
    """An English text with the template and the values that it was made from.

    Parameters
    ----------
    template : str
        With fields as `str.format` has them, each with a name: "{path}: there is no such file".
    **values
        Of the fields. One that is a `Message` is translated with the message.
    """

    template: str
    values: dict[str, object]

    def __new__(cls, template: str, **values: object) -> Message:
        """Fill in the template."""
        text = super().__new__(cls, template.format(**values) if values else template)
        text.template, text.values = template, values
        return text

    @classmethod
    def joined(cls, separator: str, messages: Iterable[str]) -> Message:
        """Several messages as one, each translated by itself."""
        values = {f"part{i}": message for i, message in enumerate(messages)}
        return cls(separator.join(f"{{{name}}}" for name in values), **values)

    def translated(self, lookup: Callable[[str], str]) -> str:
        """The text in another language, given a function from a template to the same template in that language.

        A template that the function does not know stays English. So does one whose translation cannot be filled in: a
        translator's mistake must not stop the interface.
        """
        if not self.values:
            return lookup(self.template)
        values = {
            name: value.translated(lookup) if isinstance(value, Message) else value
            for name, value in self.values.items()
        }
        for template in (lookup(self.template), self.template):
            with suppress(LookupError, ValueError, TypeError, AttributeError):
                return template.format(**values)
        return str(self)

    def to_dict(self) -> dict[str, Any]:
        """Template and values in types that JSON has; values that are neither numbers nor messages become text."""
        return {"template": self.template, "values": {name: _plain(value) for name, value in self.values.items()}}

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Message:
        """The message of which `to_dict` gave the content; KeyError, TypeError or ValueError if it is none."""
        values = {
            name: cls.from_dict(value) if isinstance(value, dict) else value
            for name, value in content["values"].items()
        }
        return cls(content["template"], **values)


def message_of(error: BaseException) -> str:
    """The text of an error; the `Message` itself if it was raised with one, which `str(error)` would lose."""
    if len(error.args) == 1 and isinstance(error.args[0], str):
        return error.args[0]
    return str(error)


def _plain(value: object) -> Any:
    """A value of a message as JSON has it."""
    if isinstance(value, Message):
        return value.to_dict()
    if isinstance(value, Integral):
        return int(value)
    return float(value) if isinstance(value, Real) else str(value)
