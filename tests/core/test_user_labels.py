"""Notes of a user on parts are kept with the model; damaged notes are refused with the name of the field."""

import json

import pytest
from shapes import creature

from wks_segment.core import ModelFileError, PartNotes, PoseSegmentation

NOTES = PartNotes({3: "Hand", 1002: "Fuß.L"}, {3: (1.0, 0.5, 0.25), 500: (0.0, 0.0, 1.0)}, {2: 3, 1001: 3})


@pytest.fixture(scope="module")
def text():
    return PoseSegmentation(3, n_eigenpairs=20, n_energies=12).fit([creature(0.0, 3)]).to_json()


def test_new_model_has_no_notes_and_none_in_its_file(text):
    assert PoseSegmentation.from_json(text).part_notes_ == PartNotes()
    assert not {"part_names", "part_colors", "joined_parts"} & set(json.loads(text))


def test_notes_are_saved_and_loaded(text, tmp_path):
    model = PoseSegmentation.from_json(text)
    model.part_notes_ = NOTES
    model.save(tmp_path / "model.json")
    loaded = PoseSegmentation.load(tmp_path / "model.json")
    assert loaded.part_notes_ == NOTES
    assert json.loads((tmp_path / "model.json").read_text())["part_names"] == {"3": "Hand", "1002": "Fuß.L"}
    assert loaded.to_json() == model.to_json()


def test_new_fit_drops_the_notes(text):
    model = PoseSegmentation.from_json(text)
    model.part_notes_ = NOTES
    assert model.fit([creature(0.0, 3)]).part_notes_ == PartNotes()


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("part_names", ["Hand"], "part_names is not a list of entries by part"),
        ("part_names", {"-1": "Hand"}, "part_names has an entry '-1', which is not a part"),
        ("part_names", {"3000": "Hand"}, "part_names has an entry '3000', which is not a part"),
        ("part_names", {"٣": "Hand"}, "which is not a part"),
        ("part_names", {"3": "Hand", "03": "Foot"}, "which is not a part or is there twice"),
        ("part_names", {"3": ""}, "part_names has for part 3 something other than a name of up to 50 letters"),
        ("part_names", {"3": " Hand"}, "something other than a name"),
        ("part_names", {"3": "x" * 51}, "something other than a name"),
        ("part_names", {"3": "a\nb"}, "something other than a name"),
        ("part_names", {"3": 7}, "something other than a name"),
        ("part_names", {"3": "Hand", "4": "Hand"}, "part_names has a name twice"),
        ("part_colors", {"3": [1, 0]}, "part_colors has for part 3 something other than a color"),
        ("part_colors", {"3": [1, 0, 1.5]}, "something other than a color"),
        ("part_colors", {"3": [1, 0, 10**400]}, "something other than a color"),
        ("part_colors", {"3": [1, 0, float("nan")]}, "something other than a color"),
        ("part_colors", {"3": [True, 0, 0]}, "something other than a color"),
        ("part_colors", {"3": "red"}, "something other than a color"),
        ("joined_parts", {"3": "4"}, "joined_parts has for part 3 something other than the number of a part"),
        ("joined_parts", {"3": 3}, "joins a part with one that is joined itself"),
        ("joined_parts", {"3": 4, "4": 5}, "joins a part with one that is joined itself"),
        ("joined_parts", None, "joined_parts is not a list"),
    ],
)
def test_damaged_notes_are_refused(text, field, value, message):
    with pytest.raises(ModelFileError, match=f"the model is damaged: .*{message}"):
        PoseSegmentation.from_json(json.dumps({**json.loads(text), field: value}))
