"""What the extension says while it works, in German: no message of the code is left in English."""

import ast
import re
from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest

from wks_segment.blender.operators import _report
from wks_segment.blender.scene.characters import CONVERTIBLE
from wks_segment.blender.ui import messages
from wks_segment.blender.ui.german import GERMAN_MESSAGES
from wks_segment.blender.ui.messages import translated
from wks_segment.blender.ui.segments_panel import PRESETS
from wks_segment.blender.ui.translations import GERMAN, GERMAN_NAMES, GERMAN_OPERATORS, MESSAGE, NAME, TRANSLATIONS

ROOT = Path(__file__).resolve().parents[3]
KNOWN = GERMAN_OPERATORS | GERMAN_MESSAGES
COMMAND_LINE = {
    "commands",
    "demo_scene",
    "retrieval",
    "file_formats",
    "terminal",
    "creature",
    "contact_sheet",
    "confusion_matrix",
    "main",
}
"""What the window has no use for."""
TABLES = {"translations", "german"}
PYTHON = (ROOT / "docs" / "refusals.md").read_text(encoding="utf-8").partition("## From Python")[2].splitlines()
"""What only somebody can meet who calls the core."""
NOT_SHOWN = {
    # Names of data, which are the user's, and are the same in all languages.
    "WKS …", "WKS Segment bake", "… ID Map", "Base Color", "Segment …", "New Segment", "WKS Segment: …",
    # Of properties that are hidden.
    "Its file in the model folder; empty: it is in this scene", "Lines on what it was learned from",
    "Names and colors of its segments, as JSON", "The model, as JSON, while another one is in use",
    "How many faces of these objects have a segment by hand", "How sure the first of the ranking is",
    "Lines on what the model was learned from", "Names and colors of segments, and which are merged, as JSON",
    "Names of the objects that were ranked, as JSON", "Row of the model whose text is below",
    "The model in use, as JSON", "What the labels in this scene are from, see `Session`",
    # What the code says to itself, or to other code.
    "OBJECT EDIT_MESH", "settings = bpy.context.scene.wks_segment", "nothing fits", "work …",
    r"^MemAvailable:\s+(\d+) kB", r"(?<=\d) (?=\d|(of|von) \d)|((?<=\d of)|(?<=\d von)) (?=\d)",
    "TriangleMesh(… vertices, … faces)", "wks_segment model",
    # Then the fast eigensolver gives way to the exact one.
    "corrections are not finite", "corrections stay large", "rounding makes the shifted operator indefinite",
    "single precision does not suffice: …", "the cells do not carry the functions of the surface",
    # On the terminal only, or to those who call the core.
    "…: the image could not be written", "…: the image could not be written: …", "pose …", "pose … of …",
    "a signature was not kept for the next time: …", "mixtures were not kept for the next time: …",
    "there are … models, and poses for … of them",
}  # fmt: skip
"""Texts of the code that are no messages of the window."""


def template(node):
    """A text of the code with `…` for what is filled in; None for anything else."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return re.sub(r"\{[a-z]*\}", "…", node.value)  # as str.format has it
    if isinstance(node, ast.JoinedStr):
        parts = (part.value if isinstance(part, ast.Constant) else "…" for part in node.values)
        return re.sub("…+", "…", "".join(parts))
    return None


def texts(tree):
    """All texts in a syntax tree but docstrings; those in the gaps of another one too."""
    left_out = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr):
            left_out.add(node.value)
        elif isinstance(node, ast.JoinedStr):
            left_out |= set(node.values)
        elif isinstance(node, ast.FormattedValue):
            left_out.add(node.format_spec)
    return {text for node in ast.walk(tree) if node not in left_out and (text := template(node))}


def is_said(text):
    """Whether a text is more than a name: words, or a word with something filled in."""
    return len(re.findall("[A-Za-z]{2,}", text)) > ("…" not in text) and " " in text.strip()


def sources():
    """The modules whose messages can be met in the window, as syntax trees by path."""
    paths = [path for part in ("core", "blender") for path in sorted((ROOT / "wks_segment" / part).rglob("*.py"))]
    left_out = COMMAND_LINE | TABLES
    return {
        path: ast.parse(path.read_text(encoding="utf-8"))
        for path in paths
        if path.stem not in left_out and path.parent.name not in left_out
    }


SOURCES = sources()
IN_CODE = set().union(*map(texts, SOURCES.values()))


def calls():
    """(module, name of what is called, call) of all calls."""
    for path, tree in SOURCES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call):
                yield path.stem, getattr(node.func, "attr", getattr(node.func, "id", "")), node


def words():
    """What is shown of one word."""
    yield from CONVERTIBLE.values()
    yield from _report.MODES.values()
    for _, name, call in calls():
        if name in ("in_panel", "in_report", "in_tooltip", "tell", "explain", "finish"):
            yield from (arg.value for arg in call.args if isinstance(arg, ast.Constant))
    for tree in SOURCES.values():
        for node in ast.walk(tree):
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) in ("verb", "self.stage"):
                yield node.value.value
            elif isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "(self.stage, self.share)":
                yield from (part.value for part in getattr(node.value, "elts", []) if isinstance(part, ast.Constant))


def german(text):
    return translated(text, lambda each: KNOWN.get(each, each))


def filled(text, marks="abcdefg"):
    """A text with something in its gaps, as the code would fill it in."""
    for mark in marks:
        text = text.replace("…", f"<{mark}>", 1)
    return text


def test_all_messages_of_the_code_have_a_german_text():
    said = {text for text in IN_CODE if is_said(text)} - {*GERMAN, *GERMAN_NAMES, *NOT_SHOWN, *PYTHON}
    assert said - KNOWN.keys() == set()
    shown = {text for text in words() if isinstance(text, str) and text}
    assert {"Learned", "Updated", "Import", "curve", "Starting", "Canceling", "There is only one segment"} <= shown
    assert shown - KNOWN.keys() == set()


def test_messages_are_found():
    assert len([text for text in IN_CODE if is_said(text)]) > 300
    assert {
        "Labels take … seconds here, too long to follow by themselves",
        "… fits, surely",
        "pose them differently",
    } < IN_CODE
    (tree,) = ast.parse("f'{a} and {f(b)} of {x:.2f}{\" gap here\" * c}'").body
    assert texts(ast.Module([ast.Return(tree.value)], [])) == {"… and … of …", " gap here"}


def test_no_text_is_of_a_message_that_is_gone():
    assert GERMAN_MESSAGES.keys() - IN_CODE == set()
    assert not NOT_SHOWN - IN_CODE


@pytest.mark.parametrize("english", GERMAN_MESSAGES)
def test_text_says_the_same(english):
    text = GERMAN_MESSAGES[english]
    assert sorted(re.findall(r"\{(\d)!?\}", text)) == [str(i + 1) for i in range(english.count("…"))]
    assert "…" not in text.replace("{", "")
    assert not text.endswith(".")
    assert text != english
    # It is found again when it is filled in, and not taken for another one.
    expected = re.sub(r"\{(\d)!?\}", lambda place: f"<{'abcdefg'[int(place[1]) - 1]}>", text)
    assert german(filled(english)) == expected
    # What is shown twice, as by Blender itself, is not changed again.
    assert german(expected) == expected


@pytest.mark.parametrize(
    ("english", "expected"),
    [
        (
            "Learned: 3 poses, 19,902 vertices, 8 segments in 12 parts, better triangles for 2, 2.5 seconds",
            "Gelernt: 3 Posen, 19,902 Vertices, 8 Segmente in 12 Teilen, bessere Dreiecke für 2, 2.5 Sekunden",
        ),
        ("1 pose · 8 segments · 2026-11-23", "1 Pose · 8 Segmente · 2026-11-23"),
        ('Signature of "Fox, frame 12" (3 of 5)', 'Signatur von "Fox, Frame 12" (3 von 5)'),
        (
            "Learn and Segment was ended, nothing is written: the mesh of \"Fox\" was edited",
            "Lernen und segmentieren: beendet, nichts ist geschrieben: das Mesh von \"Fox\" wurde bearbeitet",
        ),
        (
            '"Fox, rest position": vertex 7 of "Fur" has a coordinate that is not finite (2 such vertices)',
            '"Fox, Ruhepose": Vertex 7 von "Fur" hat eine Koordinate, die nicht endlich ist (2 solche Vertices)',
        ),
        (
            'The segments could not be learned: "Fox": the mesh has no area: all its faces are points or lines; '
            "check the scale of the mesh",
            'Die Segmente konnten nicht gelernt werden: "Fox": das Mesh hat keinen Flächeninhalt: alle seine Flächen '
            "sind Punkte oder Linien; die Skalierung des Meshs prüfen",
        ),
        ("Left out: /tmp/a.json: there is no such file", "Ausgelassen: /tmp/a.json: diese Datei gibt es nicht"),
        (
            "a.json was not loaded: the model is damaged: part_names has for part 3 something else than a name of up "
            "to 63 letters",
            "a.json wurde nicht geladen: das Modell ist beschädigt: part_names hat für Teil 3 etwas anderes als einen "
            "Namen von bis zu 63 Zeichen",
        ),
        (
            "1 a.json was not loaded: 30 MB is too large for a model",
            "1 a.json wurde nicht geladen: 30 MB sind zu groß für ein Modell",
        ),
        (
            "Fox: Cow fits best, but unsure: Ox may as well",
            "Fox: Cow passt am besten, aber unsicher: Ox kann ebenso passen",
        ),
        ('"Fox", "Cow" is gone', '"Fox", "Cow" ist weg'),
        ("No faces are hidden", "Keine Flächen sind verborgen"),
        (
            "5 faces are hidden in Edit Mode, Sculpt Mode and while painting",
            "5 Flächen sind verborgen im Edit-Modus, im Sculpt-Modus und beim Malen",
        ),
        (
            '"Text" is a text: convert it first (Object > Convert > Mesh)',
            '"Text" ist kein Mesh, sondern ein Text: erst umwandeln (Object > Convert > Mesh)',
        ),
        # Names stay as they are, also those that say something.
        ("Named No job is running", "Benannt: No job is running"),
        (
            'There is no model named "New" in the list; there are: Use, Split',
            'In der Liste ist kein Modell namens "New"; es gibt: Use, Split',
        ),
        # So does what nobody has translated, such as an error of the system.
        ("The model was not saved: disk full", "Das Modell wurde nicht gespeichert: disk full"),
        ("", ""),
        ("Fox", "Fox"),
    ],
)  # fmt: skip
def test_nested_messages(english, expected):
    assert german(english) == expected
    assert translated(english, lambda each: each) == english, "in English"


def test_blender_is_asked_for_all_of_them():
    for text, other in KNOWN.items():
        assert TRANSLATIONS["de_DE"][MESSAGE, text] == other


def test_names_to_choose_from_have_a_german_one():
    assert GERMAN_NAMES.keys() == {*PRESETS, *(name for names in PRESETS.values() for name in names)}
    assert {(NAME, name) for name in GERMAN_NAMES} <= TRANSLATIONS["de_DE"].keys()


def test_nobody_speaks_past_the_translation():
    for module, name, call in calls():
        if module != "_report":
            assert name != "poll_message_set", module
            assert not (name == "report" and len(call.args) == 2), module
        if name == "label" and module.endswith("panel"):
            given = next(keyword.value for keyword in call.keywords if keyword.arg == "text")
            assert not is_said(template(given) or ""), ast.unparse(call)


class Blender:
    """As much of Blender's translations as messages need; the module bpy is built without languages."""

    def __init__(self, locale):
        self.app, self.translations, self.locale = self, self, locale
        self.pgettext_iface = self.pgettext_tip = self.pgettext_rpt = self.pgettext

    def pgettext(self, text, context):
        return TRANSLATIONS.get(self.locale, {}).get((context, text), text)


@pytest.mark.parametrize(
    ("locale", "reported", "gray"),
    [
        ("de_DE", "a.json wurde nicht geladen: ", "Noch kein Modell: "),
        ("", "a.json was not loaded: ", "No model yet: "),
        ("fr_FR", "a.json was not loaded: ", "No model yet: "),
    ],
)
def test_operators_speak_the_language_of_the_interface(extension, scene, monkeypatch, tmp_path, locale, reported, gray):
    monkeypatch.setattr(messages, "bpy", Blender(locale))
    with pytest.raises(RuntimeError, match=reported):
        bpy.ops.wks_segment.load_model(filepath=str(tmp_path / "a.json"))
    with pytest.raises(RuntimeError, match=gray):
        bpy.ops.wks_segment.duplicate_model()


@pytest.mark.parametrize("function", [messages.in_panel, messages.in_report, messages.in_tooltip])
def test_each_place_has_its_own_setting(monkeypatch, function):
    place = {messages.in_panel: "iface", messages.in_report: "rpt", messages.in_tooltip: "tip"}[function]
    blender = Blender("de_DE")
    monkeypatch.setattr(messages, "bpy", blender)
    assert function("There is only one segment") == "Es gibt nur ein Segment"
    setattr(blender, f"pgettext_{place}", lambda text, context: text)
    assert function("There is only one segment") == "There is only one segment"


def test_job_and_panel_speak_german(extension, monkeypatch):
    from wks_segment.blender.ui.main_panel import wrapped
    from wks_segment.blender.workflow.background_job import Job

    job = Job("Learn and Segment", lambda progress: None, lambda: None)
    job.wait(5)
    job.stage, job.share = 'Signature of "Fox, frame 12" (3 of 5)', 0.375
    assert job.lines == ("Signature of Fox, frame 12 · 3 of 5", "38 %")
    monkeypatch.setattr(messages, "bpy", Blender("de_DE"))
    assert job.lines == ("Signatur von Fox, Frame 12 · 3 von 5", "38 %")
    space = "\N{NO-BREAK SPACE}"
    assert " ".join(wrapped(job.lines[0])) == f"Signatur von Fox, Frame{space}12 · 3{space}von{space}5".replace(
        f"e{space}", "e "
    )
    job.end()
    assert job.lines == ("Wird abgebrochen", "")
    said = []
    operator = SimpleNamespace(report=lambda kind, text: said.append((kind, text)))
    _report.tell(operator, {"WARNING"}, job.epitaph)
    assert said == [({"WARNING"}, "Lernen und segmentieren: abgebrochen, nichts ist geschrieben")]
