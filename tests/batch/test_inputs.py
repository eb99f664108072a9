"""Which files a batch takes, and that no two results have one name."""

from pathlib import Path

import pytest

from wks_segment.batch import BatchError, inputs_of, names_of

KNOWN = (".obj", ".glb")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for name in ("a.obj", "b.GLB", "notes.txt", "more/a.obj", "more/deep/c.obj", "out/a.obj"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def found(given, folder, known=KNOWN):
    inputs = inputs_of(given, known, Path("out"))
    return {path.relative_to(folder).as_posix(): name for (path, _), name in zip(inputs, names_of(inputs), strict=True)}


def test_a_folder_means_all_files_in_it_but_results(folder):
    assert found(["."], folder) == {
        "a.obj": "a", "b.GLB": "b", "more/a.obj": "more/a", "more/deep/c.obj": "more/deep/c",
    }  # fmt: skip


def test_a_pattern_means_what_fits(folder):
    assert found(["more/**/*.obj"], folder) == {"more/a.obj": "a", "more/deep/c.obj": "deep/c"}
    assert found(["[ab].*"], folder) == {"a.obj": "a", "b.GLB": "b"}


def test_a_file_is_taken_as_it_is_and_once(folder):
    assert found(["a.obj", "./more/../a.obj", "notes.txt"], folder) == {"a.obj": "a", "notes.txt": "notes"}


def test_files_of_one_name_keep_their_folders(folder):
    assert found(["more/a.obj", "more/deep/c.obj"], folder) == {"more/a.obj": "a", "more/deep/c.obj": "c"}
    assert found(["a.obj", "more/a.obj", "b.GLB"], folder) == {"a.obj": "a", "more/a.obj": "more/a", "b.GLB": "b"}
    (folder / "else").mkdir()
    (folder / "else" / "a.obj").touch()
    assert found(["else/a.obj", "more/a.obj"], folder) == {"else/a.obj": "else/a", "more/a.obj": "more/a"}


def test_files_of_one_name_but_for_their_format_keep_it(folder):
    (folder / "a.glb").touch()
    assert found(["a.obj", "a.glb"], folder) == {"a.obj": "a.obj", "a.glb": "a.glb"}


def test_upper_and_lower_case_are_one_name(folder):
    (folder / "more" / "A.obj").touch()
    (folder / "A.obj").touch()
    names = found(["a.obj", "A.obj", "more/A.obj"], folder).values()
    assert sorted(names) == ["A.obj 2", "a.obj", "more/A"]


@pytest.mark.parametrize(
    ("given", "said"),
    [("c.obj", "there is no such file or folder"), ("*.fbx", "no file in it"), ("out", "no file in it")],
)
def test_what_names_no_file_is_refused(folder, given, said):
    with pytest.raises(BatchError, match=said):
        found([given], folder)
