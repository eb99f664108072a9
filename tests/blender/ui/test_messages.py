"""What the extension says while it works, in German: no message of the code is left in English."""

import ast
import re
import string
from types import SimpleNamespace

import bpy
import pytest
from builders import limbed_rigged, mesh_object, select
from message_templates import SOURCES, all_calls, fields, name_of, sentences_made_on_the_spot, templates

from wks_segment.blender.operators import _report
from wks_segment.blender.ui import messages, models_panel
from wks_segment.blender.ui.german.file_texts import GERMAN_FILE_MESSAGES
from wks_segment.blender.ui.german.interface_texts import GERMAN_OPERATORS
from wks_segment.blender.ui.german.message_texts import GERMAN_MESSAGES
from wks_segment.blender.ui.german.part_names import GERMAN_NAMES
from wks_segment.blender.ui.segments_panel import NAME_PRESETS
from wks_segment.blender.ui.translations import MESSAGE, NAME, TRANSLATIONS
from wks_segment.core.message import Message

MESSAGES = GERMAN_MESSAGES | GERMAN_FILE_MESSAGES
KNOWN = GERMAN_OPERATORS | MESSAGES
TEMPLATES = templates()
NUMBERS = "bcdoxXneEfFgG%,"
"""Last letters of format specifications that take a number."""


def speaks(text):
    """Whether a template has words of its own, which need a translation."""
    return any(letter.isalpha() for literal, *_ in string.Formatter().parse(text) for letter in literal)


def written_fields(template):
    """The fields of a template with conversion and format, in the order of their names."""
    return sorted({field[1:] for field in string.Formatter().parse(template) if field[1] is not None})


def value_for(template, field):
    """A value that a field of the template can show."""
    specs = [spec for _, name, spec, _ in string.Formatter().parse(template) if name == field]
    return 3 if any(spec and spec[-1] in NUMBERS for spec in specs) else f"<{field}>"


def is_made_on_the_spot(text):
    """Whether a text is made of others without a `Message`, which takes the template away."""
    if isinstance(text, ast.JoinedStr | ast.BinOp):
        return True
    if isinstance(text, ast.IfExp):
        return is_made_on_the_spot(text.body) or is_made_on_the_spot(text.orelse)
    return isinstance(text, ast.Call) and name_of(text.func) in ("str", "format", "join", "replace", "strip", "repr")


def test_all_messages_of_the_code_have_a_german_text():
    assert {text: TEMPLATES[text] for text in TEMPLATES if speaks(text) and text not in KNOWN} == {}


def test_counts_of_faces_have_separators():
    assert [text for text in TEMPLATES if re.search(r"\{(?!face\b)\w+\} faces", text)] == []


def test_messages_are_found():
    assert len(TEMPLATES) > 200
    # By a constant of another module, an attribute, a function that returns it, a choice, a table.
    assert {
        "A job is running: wait or cancel it",
        "Starting",
        "Select the mesh of a character first",
        "The vertex groups are hard: only a model gives the probabilities of soft ones (Apply to Selected)",
        "curve",
    } <= TEMPLATES.keys()


def test_no_text_is_of_a_message_that_is_gone():
    assert MESSAGES.keys() - TEMPLATES.keys() == set()


@pytest.mark.parametrize("english", MESSAGES)
def test_text_says_the_same(english):
    german = MESSAGES[english]
    assert written_fields(german) == written_fields(english)
    assert "" not in fields(english), "fields have names"
    assert not german.endswith(".")
    assert german != english
    values = {field: value_for(english, field) for field in fields(english)}
    assert Message(english, **values).translated(KNOWN.get) == german.format(**values)


@pytest.mark.parametrize("call", all_calls(), ids=lambda call: f"{call.place} {call.name}")
def test_nobody_speaks_past_the_translation(call):
    assert not is_made_on_the_spot(call.text), f"a Message keeps its template: {ast.unparse(call.node)}"
    keywords = {keyword.arg for keyword in call.node.keywords}
    if isinstance(call.text, ast.Constant) and (call.name == "Message" or call.name.endswith("Error")):
        assert fields(call.text.value) - {"self"} == keywords or None in keywords, ast.unparse(call.node)


def test_no_sentence_is_made_on_the_spot():
    assert dict(sentences_made_on_the_spot()) == {}


def test_reports_and_labels_go_through_the_translation():
    for source in SOURCES:
        for node in ast.walk(source.tree):
            if not isinstance(node, ast.Call):
                continue
            if source.path.stem != "_report":
                assert name_of(node.func) != "poll_message_set", source.path
                assert not (name_of(node.func) == "report" and len(node.args) == 2), source.path
            if name_of(node.func) == "label" and source.path.parent.name == "ui":
                given = next(keyword.value for keyword in node.keywords if keyword.arg == "text")
                texts = [each for each in ast.walk(given) if isinstance(each, ast.Constant | ast.JoinedStr)]
                said = [each for each in texts if isinstance(each, ast.Constant) and " " in str(each.value).strip()]
                assert not said or "in_panel" in ast.unparse(given), ast.unparse(node)


@pytest.mark.parametrize(
    ("message", "english", "german"),
    [
        (Message("There is only one segment"), "There is only one segment", "Es gibt nur ein Segment"),
        ("There is only one segment", "There is only one segment", "Es gibt nur ein Segment"),
        # Names stay as they are, also those that say something.
        ("Fox", "Fox", "Fox"),
        ("", "", ""),
    ],
)
def test_shown(monkeypatch, message, english, german):
    for locale, expected in (("de_DE", german), ("de_AT", german), ("en_US", english), ("fr_FR", english)):
        monkeypatch.setattr(messages, "bpy", Blender(locale))
        assert messages.in_panel(message) == messages.in_report(message) == expected
        assert type(messages.in_panel(message)) is str, "Blender gets no Message"


@pytest.mark.parametrize("mistake", ["{unknown}", "{", "{0}", "{name.x}"])
def test_a_mistake_of_a_translator_stops_nothing(monkeypatch, mistake):
    blender = Blender("de_DE")
    blender.pgettext_iface = lambda text, context: mistake
    monkeypatch.setattr(messages, "bpy", blender)
    assert messages.in_panel(Message("{name} is gone", name="Fox")) == "Fox is gone"


def test_blender_is_asked_for_all_of_them():
    for text, other in KNOWN.items():
        assert TRANSLATIONS["de_DE"][MESSAGE, text] == other


def test_names_to_choose_from_have_a_german_one():
    assert GERMAN_NAMES.keys() == {*NAME_PRESETS, *(name for names in NAME_PRESETS.values() for name in names)}
    assert {(NAME, name) for name in GERMAN_NAMES} <= TRANSLATIONS["de_DE"].keys()


class Blender:
    """As much of Blender's translations as messages need; the module bpy is built without languages."""

    def __init__(self, locale):
        self.app, self.translations, self.locale = self, self, locale
        self.pgettext_iface = self.pgettext_tip = self.pgettext_rpt = self.pgettext

    def pgettext(self, text, context):
        language = self.locale.partition("_")[0]
        known = next((texts for locale, texts in TRANSLATIONS.items() if locale.startswith(language)), {})
        return known.get((context, text), text)


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
    from wks_segment.blender.ui.main_panel import job_texts, wrapped_lines
    from wks_segment.blender.workflow.background_job import BackgroundJob

    job = BackgroundJob("Learn and Segment", lambda progress: None, lambda: None)
    job.wait(5)
    pose = Message("{character}, {pose}", character="Fox", pose=Message("frame {frame}", frame=12))
    counted = Message("{name} ({number} of {count})", name=Message('"{pose}"', pose=pose), number=3, count=5)
    job.stage, job.share = Message("Signature of {stage}", stage=counted), 0.375
    assert job_texts(job) == ("Signature of Fox, frame 12 · 3 of 5", "38 %")
    monkeypatch.setattr(messages, "bpy", Blender("de_DE"))
    assert job_texts(job) == ("Signatur von Fox, Frame 12 · 3 von 5", "38 %")
    space = "\N{NO-BREAK SPACE}"
    assert " ".join(wrapped_lines(job_texts(job)[0])) == f"Signatur von Fox, Frame 12 ·{space}3{space}von{space}5"
    job.end()
    assert job_texts(job) == ("Wird abgebrochen", "")
    said = []
    operator = SimpleNamespace(report=lambda kind, text: said.append((kind, text)))
    _report.tell(operator, {"WARNING"}, job.end_message)
    assert said == [({"WARNING"}, "Lernen und segmentieren: abgebrochen, nichts ist geschrieben")]


def test_a_run_speaks_german(settings, printed, monkeypatch):
    select(limbed_rigged())
    settings.source, settings.pose_count = "FRAMES", 2
    monkeypatch.setattr(messages, "bpy", Blender("de_DE"))
    assert bpy.ops.wks_segment.learn() == {"FINISHED"}
    (line,) = [line for line in printed().out.splitlines() if "Gelernt" in line]
    assert re.search(r"Gelernt: 2 Posen, [\d,]+ Vertices, 4 Segmente, [\d.]+ Sekunden$", line)
    # What is stored with the scene is English, and shown in the language of whoever opens it.
    assert settings.model_summary.splitlines()[:2] == ["From Walker", "2 poses"]
    assert " ".join(models_panel.details(settings)).startswith("Aus Walker 2 Posen · ")
    monkeypatch.setattr(messages, "bpy", Blender("en_US"))
    assert " ".join(models_panel.details(settings)).startswith("From Walker 2 poses · ")
    settings.model_summary = "From a script"
    monkeypatch.setattr(messages, "bpy", Blender("de_DE"))
    assert models_panel.details(settings)[0] == "From a script"


def test_an_error_of_the_core_is_german_down_to_its_reason(settings, monkeypatch, tmp_path):
    monkeypatch.setattr(messages, "bpy", Blender("de_DE"))
    path = tmp_path / "a.json"
    path.write_text("{}", encoding="utf-8")
    with pytest.raises(RuntimeError, match=r"a.json wurde nicht geladen: das ist kein Modell von WKS Segment\s*$"):
        bpy.ops.wks_segment.load_model(filepath=str(path))
    flat = mesh_object([(0, 0, 0)] * 4, [(0, 1, 2), (0, 2, 3)], "Flat")
    select(flat)
    with pytest.raises(RuntimeError, match='"Flat": das Mesh hat keinen Flächeninhalt'):
        bpy.ops.wks_segment.learn()
