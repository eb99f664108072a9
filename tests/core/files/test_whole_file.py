"""Files appear whole or not at all."""

import errno
import os

import pytest
from full_disk import files_end_at

from wks_segment.core.files import whole_file as module
from wks_segment.core.files.whole_file import incomplete, is_disk_full, whole_file, write_whole


def refuse(*_):
    raise OSError(errno.EIO, "Input/output error")


def only(folder, content):
    """Check that a folder holds one file with a content."""
    (path,) = folder.iterdir()
    assert path.read_bytes() == content


@pytest.mark.parametrize("n_bytes", [0, 1, 4095, 4096, 9999])
def test_a_text_that_does_not_fit_leaves_the_old_one(tmp_path, n_bytes):
    path = tmp_path / "text.txt"
    path.write_text("precious")
    with files_end_at(n_bytes), pytest.raises(OSError, match=r"text\.txt") as caught:
        write_whole(path, "ü" * 5000)
    assert caught.value.filename == str(path)
    only(tmp_path, b"precious")
    with files_end_at(10_000):
        write_whole(path, "ü" * 5000)
    only(tmp_path, "ü".encode() * 5000)


def test_a_full_disk_is_told_from_other_errors(small_disk):
    disk = small_disk(64)
    with pytest.raises(OSError, match="No space left") as caught:
        write_whole(disk / "large", bytes(100_000))
    assert is_disk_full(caught.value)
    assert not list(disk.iterdir())
    (disk / "filler").write_bytes(bytes(60_000))
    assert is_disk_full(incomplete(disk / "silent"))
    assert not is_disk_full(OSError(errno.EACCES, "no"))
    error = ValueError("led to")
    error.__cause__ = caught.value
    assert is_disk_full(error)


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_an_error_at_any_step_leaves_what_was_there(tmp_path, monkeypatch, step):
    path = tmp_path / "text.txt"
    path.write_text("precious")
    monkeypatch.setattr(module.os, step, refuse)
    with pytest.raises(OSError, match=r"text\.txt"):
        write_whole(path, "new")
    only(tmp_path, b"precious")


def test_a_file_that_fails_its_check_does_not_appear(tmp_path):
    def check(path):
        raise incomplete(path)

    with pytest.raises(OSError, match=r"incompletely.*model\.json"), whole_file(tmp_path / "model.json", check) as new:
        new.write_text("half")
    assert not list(tmp_path.iterdir())


def test_a_file_that_was_not_written_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"model\.json"), whole_file(tmp_path / "model.json"):
        pass


def test_files_beside_are_moved_first(tmp_path, monkeypatch):
    moved, replace = [], os.replace
    monkeypatch.setattr(module.os, "replace", lambda a, b: (moved.append(b.name), replace(a, b)))
    with whole_file(tmp_path / "a b.obj", beside=[".mtl", ".none"]) as new:
        new.write_text("shape")
        new.with_suffix(".mtl").write_text("material")
    assert moved == ["a b.mtl", "a b.obj"]
    assert sorted(path.name for path in tmp_path.iterdir()) == moved


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "target")  # which does not exist yet
    write_whole(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "new"


def test_a_folder_that_is_gone_is_named(tmp_path):
    with pytest.raises(FileNotFoundError) as caught:
        write_whole(tmp_path / "gone" / "text.txt", "new")
    assert caught.value.filename == str(tmp_path / "gone" / "text.txt")
