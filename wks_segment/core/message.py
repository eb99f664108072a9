"""Texts for people that can be shown in another language.

The core knows only English, threads must not ask Blender for a translation, and programs read what the command line
prints. So a message is made in English where it is raised, and keeps its template and its values: the code that shows
it looks up the template in another language and fills it in again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress


class Message(str):
    """An English text together with the template and the values that it was made from.

    Parameters
    ----------
    template : str
        With named fields, as for `str.format`: "{path}: there is no such file".
    **values
        Values of the fields. A value that is a `Message` is translated together with the message.
    """

    template: str
    values: dict[str, object]

    def __new__(cls, template: str, **values: object) -> Message:
        """Fill in the template; a `Message` alone is returned as it is."""
        if isinstance(template, Message) and not values:
            return template
        text = super().__new__(cls, template.format(**values) if values else template)
        text.template, text.values = template, values
        return text

    @classmethod
    def joined(cls, separator: str, messages: Iterable[str]) -> Message:
        """Several messages as one; each is translated by itself."""
        values = {f"part{i}": message for i, message in enumerate(messages)}
        return cls(separator.join(f"{{{name}}}" for name in values), **values)

    def translated(self, lookup: Callable[[str], str]) -> str:
        """The text in another language, given a function that translates a template.

        A template that the function does not know stays English. So does a template whose translation cannot be filled
        in, because a translator's mistake must not stop the interface.
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


def message_of(error: BaseException) -> Message:
    """The text of an error; the `Message` itself if the error was raised with one, which `str(error)` would lose."""
    if len(error.args) == 1 and isinstance(error.args[0], str):
        return Message(error.args[0])
    return Message(str(error))
