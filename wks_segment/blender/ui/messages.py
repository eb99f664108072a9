"""What operators and panels say while they work, in the language of Blender's interface.

The code says everything in English, and errors pass through many hands before somebody reads them: here they are
translated, at the moment they are shown. The command line shows them as they are, for programs read it.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import bpy

from .translations import MESSAGE, TRANSLATIONS

LANGUAGES = {locale.partition("_")[0] for locale in TRANSLATIONS}
"""Those beside English."""

SEPARATORS = (": ", " · ", "; ", ", ")
"""Between what was said by several, as a pose and its error are, or several facts. The strongest one first."""


ANYTHING = "(.*?)"
FIRST = "((?=\\d)(?:(?!: | · |, ).)*?|(?!\\d)(?:(?!: | · ).)*?)"
"""What can stand where a message begins with something that is filled in: a number, or a name. Not another message up
to its colon, nor other facts."""


def _pattern(template: str) -> re.Pattern[str]:
    """What matches a message with `…` filled in."""
    first, *others = map(re.escape, template.split("…"))
    gaps = [ANYTHING if i or first else FIRST for i in range(len(others))]
    return re.compile(first + "".join(gap + part for gap, part in zip(gaps, others, strict=True)), re.DOTALL)


PATTERNS = {
    template: _pattern(template)
    for template in sorted(
        {text for texts in TRANSLATIONS.values() for context, text in texts if context == MESSAGE},
        key=lambda template: (-len(template.replace("…", "")), template),
    )
}
"""Of all messages; first the one that says most, and so is most certainly meant."""


def translated(text: str, lookup: Callable[[str], str]) -> str:
    """A message that was filled in, or several with separators between them; what is not known stays as it is.

    Parameters
    ----------
    text
        In English.
    lookup
        Gives the text of a template in another language, or the template itself. In it, {1} is what stands at the first
        `…`, as it is; {1!} is the same as a message of its own.
    """
    for template, pattern in PATTERNS.items():
        found = pattern.fullmatch(text)
        if found is None:
            continue
        other = lookup(template)
        return text if other == template else _filled(other, found.groups(), lookup)
    for separator in SEPARATORS:
        if separator in text:
            first, _, rest = text.partition(separator)
            return translated(first, lookup) + separator + translated(rest, lookup)
    return text


def _filled(template: str, given: tuple[str, ...], lookup: Callable[[str], str]) -> str:
    def fill(place: re.Match[str]) -> str:
        part = given[int(place[1]) - 1]
        return translated(part, lookup) if place[2] else part

    return re.sub(r"\{(\d)(!?)\}", fill, template)


def in_panel(text: str) -> str:
    """A message as a panel, a question or the status bar shows it; in English if the user wants that."""
    return _shown(text, bpy.app.translations.pgettext_iface)


def in_tooltip(text: str) -> str:
    """A message as a tooltip shows it."""
    return _shown(text, bpy.app.translations.pgettext_tip)


def in_report(text: str) -> str:
    """A message as a report shows it."""
    return _shown(text, bpy.app.translations.pgettext_rpt)


def _shown(text: str, pgettext: Callable[[str, str], str]) -> str:
    if bpy.app.translations.locale.partition("_")[0] not in LANGUAGES:
        return text
    return translated(text, lambda template: pgettext(template, MESSAGE))
