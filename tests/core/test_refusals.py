"""Every message with which the code refuses stands in docs/refusals.md, with its reason and what to do."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "refusals.md").read_text(encoding="utf-8").splitlines()
REFUSALS = {
    "UserError", "TooLargeError", "ChangedError", "ValueError", "TypeError", "PermissionError", "MemoryError",
    "SpectrumError", "ModelFileError", "BatchError", "ArgumentTypeError",
}  # fmt: skip
"""What is called with a message for the user."""


def literals(node):
    """The parts of a message that do not change, in order."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return [node.value]
    if isinstance(node, ast.JoinedStr):
        return [part.value for part in node.values if isinstance(part, ast.Constant)]
    return []


def messages():
    for path in sorted((ROOT / "wks_segment").rglob("*.py")):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(call, ast.Call) or not call.args:
                continue
            name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
            if name == "explain" or (name == "tell" and "INFO" not in ast.dump(call.args[1])):
                parts = literals(call.args[-1])  # what an operator tells, and why a button is gray
            else:
                parts = literals(call.args[0]) if name in REFUSALS else []
            # What only puts a name before the message of another error says nothing of its own.
            if len(re.findall("[A-Za-z]{2,}", " ".join(parts))) > 1:
                yield pytest.param(parts, id=f"{path.stem}:{call.lineno}")


@pytest.mark.parametrize("parts", messages())
def test_message_is_explained(parts):
    message = re.compile(".*".join(re.escape(part.strip()) for part in parts))
    assert any(message.search(line) for line in PAGE), f"add to docs/refusals.md: {'…'.join(parts)}"


def test_messages_are_found():
    assert len(list(messages())) > 80
