"""Messages keep template and values, so that they can be said in another language."""

import copy
import pickle
import warnings

import pytest

from wks_segment.core.message import Message, message_of

GERMAN = {
    "{path}: there is no such file": "{path}: diese Datei gibt es nicht",
    "{name} was not loaded: {reason}": "{name} wurde nicht geladen: {reason}",
    "{count} of {total} are gone": "von {total} sind {count} weg",
    "about {seconds:.1f} s left": "noch etwa {seconds:.0f} s",
    "curve": "Kurve",
}


def german(template):
    return GERMAN.get(template, template)


def test_is_its_english_text():
    message = Message("{path}: there is no such file", path="a.json")
    assert message == "a.json: there is no such file"
    assert Message("no {field} here") == "no {field} here", "there are no values"
    assert Message(message) is message


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (Message("curve"), "Kurve"),
        (Message("{path}: there is no such file", path="{name}"), "{name}: diese Datei gibt es nicht"),
        (Message("{count} of {total} are gone", count=1, total=3), "von 3 sind 1 weg"),
        (Message("about {seconds:.1f} s left", seconds=2.51), "noch etwa 3 s"),
        (
            Message("{name} was not loaded: {reason}", name="curve", reason=Message("curve")),
            "curve wurde nicht geladen: Kurve",
        ),
        (Message.joined("; ", [Message("curve"), "curve", Message("curve")]), "Kurve; curve; Kurve"),
        (Message.joined(", ", []), ""),
        (Message("unknown {path}", path=Message("curve")), "unknown Kurve"),
    ],
)
def test_translated(message, expected):
    assert message.translated(german) == expected
    assert message.translated(lambda template: template) == message


@pytest.mark.parametrize(
    "mistake", ["{other}", "{0}", "{path", "{path.name}", "{path[0][1]}", "{path:.2f}", "{path!x}"]
)
def test_a_translation_that_cannot_be_filled_in_is_english(mistake):
    message = Message("{path}: there is no such file", path="a.json")
    assert message.translated(lambda template: mistake) == message


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda error: pickle.loads(pickle.dumps(error))])
def test_an_error_keeps_its_message(copied):
    error = copied(ValueError(Message("{path}: there is no such file", path="{a}.json")))
    assert str(error) == "{a}.json: there is no such file"
    assert message_of(error).translated(german) == "{a}.json: diese Datei gibt es nicht"


def test_so_does_a_warning():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        warnings.warn(Message("{count} of {total} are gone", count=1, total=3), RuntimeWarning, stacklevel=1)
    assert message_of(caught[0].message).translated(german) == "von 3 sind 1 weg"


def test_an_error_of_the_system_says_what_it_says():
    assert message_of(FileNotFoundError(2, "gone", "a.json")) == "[Errno 2] gone: 'a.json'"
    assert message_of(KeyError(3)) == "3"
