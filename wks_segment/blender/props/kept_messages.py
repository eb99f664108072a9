"""Messages behind texts that are stored in a scene.

What a model was learned from and which model fits are stored in English, for scripts and for files that are opened
later. Their templates and values are stored beside them, so that a panel can show them in another language. A text
whose message is not known, as in a file of an older version, is shown as it is.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from ...core.message import Message


def keep_messages(settings: Any, messages: Iterable[str]) -> None:
    """Store the messages behind texts that the settings of a scene have; forget those of texts that are gone."""
    texts = [settings.verdict, settings.model_summary, *(row.summary for row in settings.models)]
    lines = {line for text in texts for line in text.splitlines()}
    known = _content(settings) | {str(each): each.to_dict() for each in messages if isinstance(each, Message)}
    settings.kept_messages = json.dumps({text: content for text, content in known.items() if text in lines})


def kept_message(settings: Any, text: str) -> str:
    """The message behind a stored text; the text itself if it is not known."""
    try:
        message = Message.from_dict(_content(settings)[text])
    except (KeyError, TypeError, ValueError, AttributeError, IndexError):
        return text
    return message if message == text else text


def _content(settings: Any) -> dict[str, Any]:
    try:
        content = json.loads(settings.kept_messages or "{}")
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}
