import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from shapes import creature

from wks_segment.core import ModelFileError, PoseSegmentation, model_file

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def text():
    return PoseSegmentation(3, n_eigenpairs=30, n_energies=20).fit([creature(0.0, 3)]).to_json()


def test_a_model_is_plain_json(text):
    content = json.loads(text)
    assert content["format"] == "wks_segment model"
    assert content["parameters"]["n_segments"] == 3


def changed(text, change):
    content = json.loads(text)
    change(content)
    return json.dumps(content)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.update(format="glTF"), "not a model of WKS Segment"),
        (lambda c: c.update(version=99), "version 99, this program reads 4: update"),
        (lambda c: c.update(version=3), "version 3, this program reads 4: learn it again"),
        (lambda c: c.pop("means"), "means is missing"),
        (lambda c: c["means"].pop(), r"means has the shape \(23, 20\), not \(24, 20\)"),
        (lambda c: c["means"][0].__setitem__(0, "x"), "means is missing or not numbers"),
        (lambda c: c["centre"].__setitem__(0, float("nan")), "centre has a number that is not finite"),
        (lambda c: c["covariances"].__setitem__(0, -1.0), "not positive"),
        (lambda c: c["spread"].__setitem__(0, 0.0), "not positive"),
        (lambda c: c.update(mixture_covariance_type="round"), "unknown covariance type"),
        (lambda c: c["parameters"].pop("n_energies"), "its parameters are not"),
        (lambda c: c["parameters"].update(accuracy="best"), "bad parameter: accuracy must be one of"),
        (lambda c: c["parameters"].update(n_segments=10**9), "n_segments is 1000000000, more than"),
        (lambda c: c["parameters"].update(n_eigenpairs=10**9), "n_eigenpairs is 1000000000, more than"),
        (lambda c: c["means"][0].__setitem__(0, 10**400), "means is missing or not numbers"),
        (lambda c: c["weights"].__setitem__(0, 0.9), "weights do not sum to 1"),
        (lambda c: c.update(weights=3), "weights is missing"),
        (lambda c: c.update(weights=[1e-6] * 10_000), "has too many numbers"),
        (lambda c: c["parameters"].update(n_segments=[3]), r"\[3\] segments of 24 components"),
        (lambda c: c["parameters"].update(n_segments=25), "25 segments of 24 components"),
        (lambda c: c["joins"].pop(), r"joins has the shape \(22, 2\), not \(23, 2\)"),
        (lambda c: c["joins"].__setitem__(1, c["joins"][0]), "which cannot be joined"),
        (lambda c: c["joins"].__setitem__(0, [0.5, 1]), "0.5, 1, which cannot be joined"),
        (lambda c: c["certainties"].__setitem__(0, 1e300), "certainties has a number of 1e"),
    ],
)
def test_a_damaged_model_is_refused_with_the_reason(text, change, message):
    with pytest.raises(ModelFileError, match=message):
        PoseSegmentation.from_json(changed(text, change))


@pytest.mark.parametrize("foreign", ["", "{", "[]", "42", '"text"', "[" * 100_000])
def test_foreign_text_is_refused(foreign):
    with pytest.raises(ModelFileError, match="not a model of WKS Segment"):
        PoseSegmentation.from_json(foreign)


def test_a_binary_file_is_refused(tmp_path):
    path = tmp_path / "model.json"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(ModelFileError, match="binary file"):
        PoseSegmentation.load(path)


def test_a_huge_file_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "model.json"
    with path.open("wb") as file:
        file.truncate(2**40)  # a sparse file of one terabyte, which takes no space on the disk
    with pytest.raises(ModelFileError, match="too large"):
        PoseSegmentation.load(path)


def test_a_model_too_large_to_be_read_again_is_not_written(tmp_path, text, monkeypatch):
    monkeypatch.setattr(model_file, "MAX_BYTES", 1000)
    with pytest.raises(ValueError, match="take fewer segments"):
        PoseSegmentation.from_json(text).save(tmp_path / "model.json")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_a_process_killed_while_it_writes_leaves_the_old_file(tmp_path, text):
    path, source = tmp_path / "model.json", tmp_path / "text.json"
    path.write_text("precious")
    source.write_text(text)
    code = (
        "import os, sys; from wks_segment.core import PoseSegmentation; "
        "os.replace = lambda *_: os.kill(os.getpid(), 9); "
        "PoseSegmentation.load(sys.argv[1]).save(sys.argv[2])"
    )
    done = subprocess.run([sys.executable, "-c", code, source, path], cwd=ROOT, timeout=120, check=False)
    assert done.returncode == -9
    assert path.read_text() == "precious"


def test_a_failed_save_leaves_the_old_file(tmp_path, text, monkeypatch):
    path = tmp_path / "model.json"
    path.write_text("precious")
    model = PoseSegmentation.from_json(text)
    monkeypatch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        model.save(path)
    assert path.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_folder_is_an_os_error(tmp_path, text):
    with pytest.raises(FileNotFoundError):
        PoseSegmentation.from_json(text).save(tmp_path / "nowhere" / "model.json")
