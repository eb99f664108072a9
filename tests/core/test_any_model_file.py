"""Damaged model files give a model that works, or a ModelFileError. `make fuzz` tries thousands of them."""

import json
import time
import tracemalloc
from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import creature
from tally import count

from wks_segment.core import ModelFileError, PoseSegmentation, Workpiece

KINDS = ("shared", "diag", "full", "bodies")
"""Covariances of models of one pose; "bodies" is a model of two meshes, whose kinds of parts have traits."""
STRANGE = [
    None, True, False, -1, 0, 1, 10**9, 10**400, 1e308, -1e308, 5e-324, float("nan"), float("inf"), "", "8", "x" * 1000,
    [], [[]], {}, {"a": 1}, [None], [[1.0, 2.0], [3.0]], [0.0] * 10_000,
]  # fmt: skip


@pytest.fixture(scope="module")
def poses():
    return [creature(bend, 3) for bend in (0.0, 0.4)]


@pytest.fixture(scope="module")
def described(poses):
    return PoseSegmentation(3, n_eigenpairs=20, n_energies=12).describe(poses[0])


@pytest.fixture(scope="module")
def body():
    return Workpiece(PoseSegmentation(3, n_eigenpairs=20, n_energies=12).describe(creature(0.4, 2)))


@pytest.fixture(scope="module")
def texts(described):
    models = {kind: PoseSegmentation(3, kind, n_eigenpairs=20, n_energies=12).fit([described]) for kind in KINDS[:3]}
    bodies = [creature(0.0, 2), creature(0.2, 2, seed=0)]
    models["bodies"] = PoseSegmentation(3, n_eigenpairs=20, n_energies=12).fit(bodies)
    return {kind: model.to_json() for kind, model in models.items()}


def places(content, path=()):
    """Path to every value in nested content."""
    yield path
    inner = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, value in inner:
        yield from places(value, (*path, key))


def replaced(content, path, change):
    for key in path[:-1]:
        content = content[key]
    change(content, path[-1])


def edited(draw, text):
    """The text with some values removed or replaced by unexpected ones."""
    content = json.loads(text)
    content.pop("digest")  # which would be wrong
    for _ in range(draw(st.integers(1, 3))):
        path = draw(st.sampled_from(list(places(content))[1:]))
        if draw(st.booleans()):
            value = deepcopy(draw(st.sampled_from(STRANGE) | st.floats() | st.integers()))
            replaced(content, path, lambda inner, key, value=value: inner.__setitem__(key, value))
        else:
            replaced(content, path, lambda inner, key: inner.__delitem__(key))
    return json.dumps(content).encode()


def truncated(draw, text):
    return text.encode()[: draw(st.integers(0, len(text) - 1))]


def overwritten(draw, text):
    data = bytearray(text.encode())
    for _ in range(draw(st.integers(1, 20))):
        data[draw(st.integers(0, len(data) - 1))] = draw(st.integers(0, 255))
    return bytes(data)


def nested(draw, text):
    opening, closing = draw(st.sampled_from([(b"[", b"]"), (b'{"a":', b"}")]))
    depth = draw(st.integers(10, 200_000))
    return opening * depth + b"0" + closing * depth


def foreign(draw, text):
    return draw(st.binary(max_size=2000))


DAMAGES = {damage.__name__: damage for damage in (edited, truncated, overwritten, nested, foreign)}


@pytest.fixture(scope="module")
def small():
    """A body of 42 vertices, which is refined all the same."""
    return creature(0.3, 1)


def negative(value):
    return [negative(each) for each in value] if isinstance(value, list) else -value


def first_number(value, new):
    """The same nested lists with another first number."""
    return [first_number(value[0], new), *value[1:]] if isinstance(value, list) else new


def changes_of(value):
    """A value of a model file with another type, sign, size, shape or length, by name."""
    yield from {"none": None, "true": True, "text": "4", "object": {}, "huge text": "x\x1b[31m" * 5000}.items()
    if isinstance(value, str):
        return
    yield from {"empty": [], "nested": [value], "negative": negative(value)}.items()
    for number in (0, 1, -1, 0.5, 5000, 1e5, 10**30, float("nan")):
        yield f"number {number}", number
        if isinstance(value, list) and value:
            yield f"first {number}", first_number(value, number)
    if isinstance(value, list) and value:
        yield from {"shorter": value[:-1], "longer": [*value, value[-1]], "very long": value * 3000}.items()
        yield "truth values", first_number(value, True)
        yield "transposed", np.array(value).T.tolist()


SECONDS, BYTES = 5.0, 500e6
"""What a model of a stranger may take to label a small body, unless the estimate said more."""


def ended(content, mesh):
    """How it ends to label a body with a model of this content: in time, and without much memory."""
    tracemalloc.start()
    start = time.process_time()
    try:
        model = PoseSegmentation.from_json(json.dumps(content))
        seconds, needed = model.estimate([mesh])
        if seconds > SECONDS or needed > BYTES:
            return "above limits"
        labels = model.segment_faces(mesh)
        assert 0 <= labels.min() <= labels.max() < model.n_segments_
        return "labeled"
    except ModelFileError as error:
        text = str(error)
        assert text.isprintable(), text
        assert 20 < len(text) < 400, text
        return "refused"
    finally:
        taken, peak = time.process_time() - start, tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < BYTES
        assert taken < 2 * SECONDS  # which takes longer while memory is traced


@pytest.mark.parametrize("kind", [KINDS[0], "bodies"])
def test_every_field_of_a_model_changed_in_every_way(texts, small, kind):
    original = json.loads(texts[kind])
    original.pop("digest")
    assert ended(original, small) == "labeled"
    parameters = original.pop("parameters")
    changed = [
        *((change, {"parameters": parameters | {name: value}}) for name in parameters for change, value in
          changes_of(parameters[name])),
        *((change, {"parameters": parameters, name: value}) for name in original for change, value in
          changes_of(original[name])),
    ]  # fmt: skip
    few = settings().max_examples < 100  # all of them by `make fuzz`
    for change, fields in changed[:: 11 if few else 1]:
        count("changed field", [change], ended(original | fields, small))


@pytest.mark.parametrize("opening", ["[", "{", "[[", "0"])
def test_nineteen_megabytes_of_small_values_take_little_memory(tmp_path, opening):
    closing = opening.translate(str.maketrans("[{0", "]} "))
    path, text = tmp_path / "model.json", f"{opening}{closing},"
    path.write_text("[" + text * (19_000_000 // len(text)) + "0]")
    tracemalloc.start()
    with pytest.raises(ModelFileError, match="too many values"):
        PoseSegmentation.load(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 200e6


@pytest.mark.parametrize("kind", KINDS)
@given(st.data())
def test_a_model_or_a_reason_within_a_second_and_without_much_memory(
    texts, described, body, tmp_path_factory, kind, data
):
    name = data.draw(st.sampled_from(sorted(DAMAGES)))
    content = DAMAGES[name](data.draw, texts[kind])
    path = tmp_path_factory.getbasetemp() / "damaged.json"
    path.write_bytes(content)
    tracemalloc.start()
    start = time.process_time()
    try:
        model = PoseSegmentation.load(path)
    except ModelFileError as error:
        assert len(str(error)) > 20, error
        model = None
    seconds, peak = time.process_time() - start, tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert seconds < 5  # one second without the tracing of memory
    assert peak < 60e6 + 40 * len(content)
    if model is None:
        count("model file", [name], "refused")
        return
    try:
        posteriors = model.predict_proba(described)
        if model.of_bodies_:
            labels = model.segment_faces(body)
            assert 0 <= labels.min() <= labels.max() < model.n_segments_
    except ValueError as error:
        assert "energies" in str(error)  # a valid model with another number of energies than the signature
        count("model file", [name], "of another size")
        return
    np.testing.assert_allclose(posteriors.sum(axis=1), 1, atol=1e-5)
    count("model file", [name], "read")
