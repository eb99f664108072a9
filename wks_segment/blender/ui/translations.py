"""The interface in other languages, for `bpy.app.translations`. English is in the code; German is complete."""

from __future__ import annotations

from .german.file_texts import GERMAN_FILE_MESSAGES
from .german.interface_texts import GERMAN_INTERFACE, GERMAN_OPERATORS
from .german.message_texts import GERMAN_MESSAGES
from .german.part_names import GERMAN_NAMES

OPERATOR = "Operator"
"""Blender's context for names of operators. Names and descriptions of everything else are in its default context."""

MESSAGE = "WKS Segment"
"""Our own context for messages. Names of operators are in it as well, because messages mention them."""

NAME = "WKS Segment name"
"""Our own context for names of parts of a body, so that "Arm" is not taken for another word of Blender's."""

TRANSLATIONS = {
    "de_DE": {("*", text): german for text, german in GERMAN_INTERFACE.items()}
    | {(OPERATOR, text): german for text, german in GERMAN_OPERATORS.items()}
    | {(MESSAGE, text): german for text, german in (GERMAN_OPERATORS | GERMAN_MESSAGES | GERMAN_FILE_MESSAGES).items()}
    | {(NAME, text): german for text, german in GERMAN_NAMES.items()}
}
"""By language: text by context and English text."""
