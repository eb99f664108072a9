"""The models that come with the extension: they can be read, are small, and are what the script makes."""

import os
from pathlib import Path

import pytest

import wks_segment
from wks_segment.core import DiskCache, PoseSegmentation

FOLDER = Path(wks_segment.__file__).parent / "models"
NAMES = ("human", "quadruped")
LARGEST = 300_000
"""Bytes of a file."""
DATA = os.environ.get("WKS_SEGMENT_DATA", "")
"""Folder with the files that the models are made from; see `scripts.make_starter_models`."""


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_model_is_read_and_names_all_of_its_parts(name):
    path = FOLDER / f"{name}.json"
    model = PoseSegmentation.load(path)
    assert path.stat().st_size < LARGEST
    assert model.n_segments_ == model.taught_.n_parts
    assert set(model.part_notes_.names) == set(range(model.n_segments_))
    assert model.to_json() == path.read_text(encoding="utf-8")


def test_people_have_left_and_right_parts():
    model = PoseSegmentation.load(FOLDER / "human.json")
    names = model.part_notes_.names
    for group in model.taught_.sided:
        left, right = names[int(model.taught_.left[group])], names[int(model.taught_.right[group])]
        assert (left[-2:], right[-2:]) == (".L", ".R")
        assert left[:-2] == right[:-2]
    assert len(model.taught_.sided) == 6


@pytest.mark.skipif(not DATA, reason="WKS_SEGMENT_DATA names no folder with the files that models are made from")
@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_model_is_what_the_script_makes(name, tmp_path):
    from scripts import make_starter_models

    cache = DiskCache(tmp_path / "signatures")
    lessons = {
        "human": lambda: make_starter_models.human_lesson(Path(DATA) / "makehuman", cache),
        "quadruped": lambda: make_starter_models.quadruped_lesson(Path(DATA) / "characters", cache, tmp_path / "rigs"),
    }
    made = make_starter_models.rounded(lessons[name]().taught())
    assert made.to_json() == (FOLDER / f"{name}.json").read_text(encoding="utf-8")
