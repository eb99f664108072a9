"""Finds the texts in the code that a person can see in the window: the keys of the table of translations.

A text counts if it is handed to what shows it (`tell`, `explain`, `in_panel` …), to an error, to a warning, to a step
of `Progress`, or to `Message`, or if it is a sentence that a function returns. It must be a constant: a template with
named fields. `cli` and `render` are left out, for they speak on the terminal only, and so are errors of `INTERNAL`.
"""

import ast
import builtins
import re
import string
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[3] / "wks_segment"
TERMINAL = {"cli", "render"}
INTERNAL = {"NotConvergedError", "SingularError", "TypeError", "KeyError", "AssertionError", "NotImplementedError"}
"""Errors that the code catches itself, or that only a programmer can cause."""
POSITIONS = {
    **dict.fromkeys(["Message", "in_panel", "in_tooltip", "in_report", "wrapped", "warn", "titled"], 0),
    **dict.fromkeys(["explain", "step", "each", "progress", "finish"], 1),
    **dict.fromkeys(["tell", "part"], 2),
}
"""Where a call has its text, by the name of what is called; errors have it first."""
KEYWORDS = {"text", "stage", "template"}


@dataclass(frozen=True)
class Call:
    """A call that shows a text, or makes one."""

    place: str
    name: str
    text: ast.expr
    node: ast.Call
    scope: ast.AST


class Source:
    """A module: its calls that show texts, and the constants that its names stand for."""

    def __init__(self, path):
        self.path = path
        self.tree = ast.parse(path.read_text(encoding="utf-8"))
        self.calls = list(self._calls())

    def _calls(self):
        """Calls that show a text, each with the function around it."""
        for scope in [self.tree, *(node for node in ast.walk(self.tree) if isinstance(node, ast.FunctionDef))]:
            for node in own_nodes(scope):
                if isinstance(node, ast.Call) and (text := text_of(node)) is not None:
                    place = f"{self.path.relative_to(PACKAGE)}:{node.lineno}"
                    yield Call(place, name_of(node.func), text, node, scope)


def own_nodes(scope):
    """The nodes of a module or a function that are in no function within it."""
    for child in ast.iter_child_nodes(scope):
        yield child
        if not isinstance(child, ast.FunctionDef):
            yield from own_nodes(child)


def assignments(nodes):
    """(name, value) of assignments; an attribute goes by its last name."""
    for node in nodes:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    yield from zip(target.elts, node.value.elts, strict=True)
                else:
                    yield target, node.value


def name_of(node):
    """The last name of what is called or assigned to."""
    return getattr(node, "attr", getattr(node, "id", ""))


def is_error(name):
    """Whether what is called is an exception that a person may read."""
    known = getattr(builtins, name, None)
    by_name = name.endswith(("Error", "Warning")) and name[0].isupper()
    return name not in INTERNAL and (by_name or (isinstance(known, type) and issubclass(known, Exception)))


def text_of(call):
    """What a call shows; None if it shows nothing."""
    name = name_of(call.func)
    position = 0 if is_error(name) else POSITIONS.get(name)
    if position is None:
        return None
    if len(call.args) > position:
        return call.args[position]
    return next((keyword.value for keyword in call.keywords if keyword.arg in KEYWORDS), None)


def sources():
    """The modules whose texts can be seen in the window."""
    for part in ("core", "rigs", "blender"):
        for path in sorted((PACKAGE / part).rglob("*.py")):
            if path.name != "message.py" and not TERMINAL & set(path.relative_to(PACKAGE).parts):
                yield Source(path)


SOURCES = list(sources())


def shared_names():
    """What names can stand for in all modules: constants, attributes, and functions for what they return."""
    found = defaultdict(list)
    for source in SOURCES:
        for target, value in assignments(ast.walk(source.tree)):
            is_attribute = isinstance(target, ast.Attribute) and target.attr != "name"  # data has names of its own
            if is_attribute or name_of(target).isupper():
                found[name_of(target)].append(value)
        for node in ast.walk(source.tree):
            if isinstance(node, ast.ClassDef):
                for target, value in assignments(node.body):
                    found[name_of(target)].append(value)
            elif isinstance(node, ast.FunctionDef):
                inner = [each.value for each in own_nodes(node) if isinstance(each, ast.Return) and each.value]
                found[f"{node.name}()"] += [(value, node) for value in inner]
    return found


SHARED = shared_names()


def constants(node, scope, seen=frozenset()):
    """Constant texts that an expression can stand for; a name stands for whatever is assigned to it."""
    if isinstance(node, ast.Constant):
        return {node.value} if isinstance(node.value, str) and node.value else set()
    if isinstance(node, ast.Call) and text_of(node) is not None:
        return set()  # it is collected by itself
    parts = []
    if isinstance(node, ast.IfExp):
        parts = [node.body, node.orelse]
    elif isinstance(node, ast.BoolOp | ast.Dict):
        parts = node.values
    elif isinstance(node, ast.List | ast.Tuple):
        parts = node.elts
    elif isinstance(node, ast.Starred | ast.Subscript):
        parts = [node.value]
    elif isinstance(node, ast.Name | ast.Attribute | ast.Call) and (name := called_or_name(node)) not in seen:
        seen |= {name}
        parts = list(SHARED[name])
        if isinstance(node, ast.Name):
            parts += [value for target, value in assignments(own_nodes(scope)) if name_of(target) == name]
    pairs = (part if isinstance(part, tuple) else (part, scope) for part in parts)
    return set().union(*(constants(part, place, seen) for part, place in pairs))


def called_or_name(node):
    """A name; with brackets if it is called."""
    return f"{name_of(node.func)}()" if isinstance(node, ast.Call) else name_of(node)


def templates():
    """{template: places} of all texts that can be seen in the window."""
    found = defaultdict(set)
    for call in all_calls():
        for text in constants(call.text, call.scope):
            found[text].add(call.place)
    for source in SOURCES:
        for node in ast.walk(source.tree):
            if isinstance(node, ast.Return) and node.value is not None:
                for text in filter(is_sentence, constants(node.value, node)):
                    found[text].add(f"{source.path.relative_to(PACKAGE)}:{node.lineno}")
    return found


def is_sentence(text):
    """Whether a text reads like one for a person: several words, and no name, in which all words are capitalized."""
    words = re.findall("[A-Za-z]{2,}", text)
    return " " in text.strip() and len(words) > 1 and any(map(str.islower, words))


def sentences_made_on_the_spot():
    """(place, f-string) of all f-strings that read like a sentence, wherever they go to."""
    for source in SOURCES:
        internal = {part for node in ast.walk(source.tree) if is_internal(node) for part in ast.walk(node)}
        for node in ast.walk(source.tree):
            if isinstance(node, ast.JoinedStr) and node not in internal and is_sentence(literals(node)):
                yield f"{source.path.relative_to(PACKAGE)}:{node.lineno}", ast.unparse(node)


def is_internal(node):
    """Whether an error of `INTERNAL` is made, or what Python shows of an object."""
    if isinstance(node, ast.FunctionDef):
        return node.name == "__repr__"
    return isinstance(node, ast.Call) and name_of(node.func) in INTERNAL


def literals(node):
    """The text of an f-string, with {} for the values."""
    return "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)


def fields(template):
    """Names of the fields of a template; an unnamed one is ""."""
    return {name.partition(".")[0] for _, name, _, _ in string.Formatter().parse(template) if name is not None}


def all_calls():
    """All calls that show a text."""
    return [call for source in SOURCES for call in source.calls]
