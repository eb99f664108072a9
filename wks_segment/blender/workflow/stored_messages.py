"""Messages that are stored in a file: as English text for scripts, and beside it with templates and values.

What is shown later, maybe by a Blender in another language, is filled in again from the templates.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from ...core.message import Message


def as_text(messages: Sequence[str]) -> str:
    """The English text of messages, a line for each."""
    return "\n".join(messages)


def as_json(messages: Sequence[str]) -> str:
    """Messages with their templates and values."""
    return json.dumps([_as_plain(message) for message in messages])


def restored(text: str, stored: str) -> list[str]:
    """The messages that a text was stored with; its lines if there are none, or none that say the same."""
    messages = from_json(stored)
    return messages if messages and as_text(messages) == text else text.splitlines()


def from_json(stored: object) -> list[str]:
    """The messages in JSON, none if it is damaged: model files come from anywhere."""
    try:
        messages = [_from_plain(fields) for fields in json.loads(str(stored))]
    except (ValueError, LookupError, TypeError, AttributeError):
        return []
    return messages if all(isinstance(message, str) for message in messages) else []


def _as_plain(value: object) -> Any:
    if isinstance(value, Message):
        return {"template": value.template, "values": {name: _as_plain(each) for name, each in value.values.items()}}
    return value if isinstance(value, str | int | float) else str(value)


def _from_plain(fields: Any) -> Any:
    if isinstance(fields, dict):
        values = {name: _from_plain(value) for name, value in fields["values"].items()}
        return Message(fields["template"], **values)
    return fields
