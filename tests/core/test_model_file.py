import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from shapes import creature, figure

from wks_segment.core import ModelFileError, PoseSegmentation, model_file
from wks_segment.core.learning.part_mixture import PER_SEGMENT
from wks_segment.core.parts.patches import N_PATCHES, SINGLE_FACES

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def text():
    return PoseSegmentation(3, n_eigenpairs=30, n_energies=20).fit([creature(0.0, 3)]).to_json()


@pytest.fixture(scope="module")
def text_of_bodies():
    """Of two meshes, so that regions get kinds."""
    meshes = [creature(0.0, 2, seed=0), figure(subdivisions=2)]
    return PoseSegmentation(3, n_eigenpairs=30, n_energies=20).fit(meshes).to_json()


def test_a_model_is_plain_json(text):
    content = json.loads(text)
    assert content["format"] == "wks_segment model"
    assert content["parameters"]["n_segments"] == 3


def test_the_model_of_bodies_is_kept_as_one(text, text_of_bodies):
    model, mesh = PoseSegmentation.from_json(text_of_bodies), figure(0.3, 0.0, 2)
    assert model.to_json() == text_of_bodies
    assert model.of_bodies_
    again = PoseSegmentation.from_json(model.to_json())
    np.testing.assert_array_equal(again.segment_faces(mesh), model.segment_faces(mesh))
    assert not PoseSegmentation.from_json(text).of_bodies_


def changed(text, change):
    """The text after a change, and the number of components before."""
    content = json.loads(text)
    count = len(content["weights"])
    change(content)
    return json.dumps(content), count


def check_refused(text, change, message):
    """`K` in the message stands for the number of components, `L` for one less, `M` for one more."""
    damaged, count = changed(text, change)
    for name, number in (("K", count), ("L", count - 1), ("M", count + 1)):
        message = re.sub(rf"\b{name}\b", str(number), message)
    with pytest.raises(ModelFileError, match=message):
        PoseSegmentation.from_json(damaged)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.update(format="glTF"), "not a model of WKS Segment"),
        (lambda c: c.update(version=99), "version 99, this program reads 5: update"),
        (lambda c: c.update(version=3), "version 3, this program reads 5: learn it again"),
        (lambda c: c.pop("means"), "means is missing"),
        (lambda c: c["means"].pop(), r"means has the shape \(L, 20\), not \(K, 20\)"),
        (lambda c: c["means"][0].__setitem__(0, "x"), "means is missing or not numbers"),
        (lambda c: c["centre"].__setitem__(0, float("nan")), "centre has a number that is not finite"),
        (lambda c: c["covariances"][0].__setitem__(0, -1.0), "not positive"),
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
        (lambda c: c["parameters"].update(n_segments=[3]), r"n_segments cannot be \[3\]"),
        (lambda c: c["parameters"].update(n_segments=len(c["weights"]) + 1), "M segments of K components"),
        (lambda c: c["joins"].pop(), r"joins has the shape \(\d+, 2\), not \(L, 2\)"),
        (lambda c: c["joins"].__setitem__(1, c["joins"][0]), "which cannot be joined"),
        (lambda c: c["joins"].__setitem__(0, [0.5, 1]), "0.5, 1, which cannot be joined"),
        (lambda c: c["certainties"].__setitem__(0, 1e300), "certainties has a number of 1e"),
        (lambda c: c.pop("likeness"), "likeness is missing"),
        (lambda c: c["likeness"].pop(), r"likeness has the shape \(L,\), not \(K,\)"),
        (lambda c: c.pop("n_kinds"), "n_kinds is missing"),
        (lambda c: c.update(n_kinds=0), "n_kinds has the number 0, which is not a whole number from 1 to K"),
        (lambda c: c.update(n_kinds=2.5), "n_kinds has the number 2.5, which is not a whole number from 1 to K"),
        (lambda c: c.update(n_kinds=10**9), r"n_kinds has the number 1e\+09, which is not a whole number from 1 to K"),
        (lambda c: c.update(natural=len(c["weights"]) + 1), "natural has the number M, which is not a whole number"),
        (lambda c: c.update(version=4), "cuts is missing"),
    ],
)
def test_a_damaged_model_is_refused_with_the_reason(text, change, message):
    check_refused(text, change, message)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c["parameters"].update(n_eigenpairs=True), "n_eigenpairs cannot be True"),
        (lambda c: c["parameters"].update(smoothness=False), "smoothness cannot be False"),
        (lambda c: c.update(n_kinds=True), "n_kinds is missing or not numbers"),
        (lambda c: c["weights"].__setitem__(0, str(c["weights"][0])), "weights is missing or not numbers"),
        (lambda c: c["means"][0].__setitem__(0, 1e5 * c["means"][0][0]), "means has a number that is far too large"),
        (lambda c: c["certainties"].__setitem__(0, -0.5), "certainties has a negative number"),
        (lambda c: c["region_distance"][0].__setitem__(0, -1.0), "region_distance has a negative number"),
        (lambda c: c["region_area"].__setitem__(0, 2.0), "region_area has a number of 2, too large"),
        (lambda c: c.update(version="5\x1b[31m" + "x" * 1000), r"version '5\\x1b\[31mx{5,50}…?"),
        (lambda c: c["parameters"].update(accuracy="\n" * 300), r"accuracy cannot be '(\\n)+"),
    ],
)
def test_what_no_fit_makes_is_refused_also_without_a_digest(text, change, message):
    def without_digest(content):
        content.pop("digest")
        change(content)

    check_refused(text, without_digest, message)
    damaged, _ = changed(text, without_digest)
    with pytest.raises(ModelFileError) as caught:
        PoseSegmentation.from_json(damaged)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize("name", ["means", "covariances", "region_signature", "likeness", "usual_scores", "centre"])
def test_arrays_of_another_model_are_refused(text, name):
    other = json.loads(PoseSegmentation(3, n_eigenpairs=30, n_energies=20).fit([creature(0.3, 3)]).to_json())
    content = json.loads(text)
    if np.shape(content[name]) != np.shape(other[name]):
        other[name] = np.array(content[name])[::-1].tolist()
    with pytest.raises(ModelFileError, match="numbers are not those that were saved"):
        PoseSegmentation.from_json(json.dumps(content | {name: other[name]}))


def test_what_people_edit_by_hand_needs_no_new_digest(text):
    content = json.loads(text)
    content["parameters"] |= {"smoothness": 0.5, "n_segments": 2}
    content["part_names"] = {"0": "Head"}
    model = PoseSegmentation.from_json(json.dumps(content, indent=2))
    assert (model.smoothness, model.part_notes_.names) == (0.5, {0: "Head"})
    assert json.loads(model.to_json())["digest"] == content["digest"]
    content["parameters"]["n_eigenpairs"] = 300
    with pytest.raises(ModelFileError, match="numbers are not those that were saved"):
        PoseSegmentation.from_json(json.dumps(content))


def test_a_model_without_a_digest_is_read(text):
    content = json.loads(text)
    content.pop("digest")
    assert PoseSegmentation.from_json(json.dumps(content)).to_json() == text


def test_the_estimate_of_a_model_with_thousands_of_eigenpairs_is_large(text):
    """It passed the limit of five minutes, and took much longer."""
    content = json.loads(text)
    content.pop("digest")
    content["parameters"]["n_eigenpairs"] = 5000
    assert PoseSegmentation.from_json(json.dumps(content)).estimate([creature(0.0, 2)])[0] > 1000


@pytest.fixture(scope="module")
def text_with_traits(text_of_bodies):
    """As files were written before: with sizes and neighbors of kinds in place of the word that it is of bodies."""
    content = json.loads(text_of_bodies)
    count = content["n_kinds"]
    content.pop("digest")
    content.pop("of_bodies")
    traits = {"mean": [-2.0] * count, "spread": [0.5] * count, "touching": [[0.5] * count] * count}
    return json.dumps(content | {f"kind_{name}": values for name, values in traits.items()})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.pop("kind_spread"), "kind_spread is missing"),
        (lambda c: c["kind_mean"].pop(), "kind_mean has the shape"),
        (lambda c: c.update(n_kinds=c["n_kinds"] - 1), "kind_mean has the shape"),
        (lambda c: c["kind_spread"].__setitem__(0, 0.0), "kind_spread has a number that is not positive"),
        (lambda c: c["kind_touching"].pop(), "kind_touching has the shape"),
        (lambda c: c["kind_touching"][0].__setitem__(0, 0.0), "kind_touching has a number that is not positive"),
        (lambda c: c["kind_touching"][0].__setitem__(0, 1.0), "kind_touching has a number of 1, too large"),
        (lambda c: c["kind_mean"].__setitem__(0, float("nan")), "kind_mean has a number that is not finite"),
    ],
)
def test_damaged_traits_of_kinds_are_refused_with_the_reason(text_with_traits, change, message):
    check_refused(text_with_traits, change, message)


def test_a_model_of_bodies_with_traits_of_its_kinds_is_one_of_bodies(text_of_bodies, text_with_traits):
    model = PoseSegmentation.from_json(text_with_traits)
    assert model.of_bodies_
    assert model.to_json() == text_of_bodies


def test_a_file_may_have_as_many_components_as_a_fit_makes():
    """Two for each segment, and one more for each kind at most: there is at least one, and numbers are rounded."""
    most_segments = model_file.MOST_OF_PARAMETER["n_segments"]
    assert PER_SEGMENT * most_segments + max(N_PATCHES + 2, SINGLE_FACES) <= model_file.MOST_COMPONENTS


@pytest.fixture(scope="module")
def old_model():
    """Of version 4, written by WKS Segment 0.1.0; see tests/blender/test_old_files.py."""
    return PoseSegmentation.load(ROOT / "tests/blender/data/version_0_1_0/model.json")


def test_segments_of_an_old_model_are_unions_of_components_as_before(old_model):
    mesh, tree = creature(0.2, 3), old_model.grouping_
    assert (tree.n_kinds, old_model.of_bodies_) == (len(old_model.mixture_.weights), False)
    pose = old_model.describe(mesh)
    samples = old_model.standardizer_.transform(pose.signature)
    components = old_model.mixture_.posteriors(samples)
    for count in (2, 4, 7):
        expected = components @ np.eye(count)[tree.groups(count)]
        found = old_model.with_segments(count).predict_proba(pose)
        np.testing.assert_allclose(found, pose.surface.to_vertices(expected), atol=1e-5)
        assert set(old_model.with_segments(count).segment_faces(pose)) <= set(range(count))


def test_an_open_number_of_segments_of_an_old_model_is_the_largest_that_is_nearly_as_certain_as_the_best(old_model):
    curve = old_model.grouping_.curve()[1:16]
    near = [number for number, certainty in enumerate(curve, start=2) if certainty >= curve.max() - 0.06]
    assert old_model.with_segments("auto").n_segments_ == near[-1]


def test_an_old_model_has_fragments_where_borders_are_long(old_model):
    cuts = json.loads((ROOT / "tests/blender/data/version_0_1_0/model.json").read_text())["cuts"]
    fragmented = next(count for count, cut in enumerate(cuts, start=1) if cut > 10)
    for most in (2, 5, len(cuts)):
        assert old_model.grouping_.number_of_wholes(most) == max(2, fragmented - 1)


def test_an_old_model_is_written_in_the_new_version(old_model):
    text = old_model.to_json()
    assert json.loads(text)["version"] == 5
    again = PoseSegmentation.from_json(text)
    assert again.to_json() == text
    assert again.with_segments("auto").n_segments_ == old_model.with_segments("auto").n_segments_
    pose = again.describe(creature(0.2, 3))
    np.testing.assert_array_equal(again.segment_faces(pose), old_model.segment_faces(pose))
    np.testing.assert_array_equal(again.segment_regions(pose), old_model.segment_regions(pose))


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
