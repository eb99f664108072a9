"""Input files of a batch, and unique names of their results."""

from pathlib import Path

import pytest

from wks_segment.batch import BatchError, find_inputs, result_names

KNOWN = (".obj", ".glb")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for name in ("a.obj", "b.GLB", "notes.txt", "more/a.obj", "more/deep/c.obj", "out/a.obj"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def names(arguments, folder, known=KNOWN):
    inputs = find_inputs(arguments, known, Path("out"))
    return {
        path.relative_to(folder).as_posix(): name for (path, _), name in zip(inputs, result_names(inputs), strict=True)
    }


def test_a_folder_stands_for_all_files_in_it_except_results(folder):
    assert names(["."], folder) == {
        "a.obj": "a", "b.GLB": "b", "more/a.obj": "more/a", "more/deep/c.obj": "more/deep/c",
    }  # fmt: skip


def test_a_pattern_stands_for_matching_files(folder):
    assert names(["more/**/*.obj"], folder) == {"more/a.obj": "a", "more/deep/c.obj": "deep/c"}
    assert names(["[ab].*"], folder) == {"a.obj": "a", "b.GLB": "b"}


def test_a_file_is_taken_once_whatever_its_format(folder):
    assert names(["a.obj", "./more/../a.obj", "notes.txt"], folder) == {"a.obj": "a", "notes.txt": "notes"}


def test_files_with_the_same_name_keep_their_folders(folder):
    assert names(["more/a.obj", "more/deep/c.obj"], folder) == {"more/a.obj": "a", "more/deep/c.obj": "c"}
    assert names(["a.obj", "more/a.obj", "b.GLB"], folder) == {
        "a.obj": "a",
        "more/a.obj": "more/a",
        "b.GLB": "b",
    }
    (folder / "else").mkdir()
    (folder / "else" / "a.obj").touch()
    assert names(["else/a.obj", "more/a.obj"], folder) == {"else/a.obj": "else/a", "more/a.obj": "more/a"}


def test_files_that_differ_in_suffix_only_keep_it(folder):
    (folder / "a.glb").touch()
    assert names(["a.obj", "a.glb"], folder) == {"a.obj": "a.obj", "a.glb": "a.glb"}


def test_names_that_differ_in_case_only_count_as_equal(folder):
    (folder / "more" / "A.obj").touch()
    (folder / "A.obj").touch()
    found = names(["a.obj", "A.obj", "more/A.obj"], folder).values()
    assert sorted(found) == ["A.obj 2", "a.obj", "more/A"]


@pytest.mark.parametrize(
    ("argument", "message"),
    [
        ("c.obj", "there is no such file or folder"),
        ("*.fbx", "no file in it can be read"),
        ("out", "no file in it can be read"),
    ],
)
def test_an_argument_without_files_is_refused(folder, argument, message):
    with pytest.raises(BatchError, match=message):
        names([argument], folder)
