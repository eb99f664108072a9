"""Texts in the language of Blender's interface.

The code says everything in English. A `Message` keeps its template and its values on the way to the place that shows
it; here the template is looked up and filled in again, at the moment it is shown. The command line shows the English
text, because programs read it.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ...core.message import Message
from .translations import MESSAGE, TRANSLATIONS

LANGUAGES = {locale.partition("_")[0] for locale in TRANSLATIONS}
"""Languages of the interface other than English, without the country."""


def in_panel(text: str) -> str:
    """A text as a panel, a dialog or the status bar shows it; English if the user wants that."""
    return _shown(text, bpy.app.translations.pgettext_iface)


def in_tooltip(text: str) -> str:
    """A text as a tooltip shows it."""
    return _shown(text, bpy.app.translations.pgettext_tip)


def in_report(text: str) -> str:
    """A text as a report shows it."""
    return _shown(text, bpy.app.translations.pgettext_rpt)


def _shown(text: str, pgettext: Callable[[str, str], str]) -> str:
    if bpy.app.translations.locale.partition("_")[0] not in LANGUAGES:
        return str(text)
    message = text if isinstance(text, Message) else Message(text)
    return message.translated(lambda template: pgettext(template, MESSAGE))
