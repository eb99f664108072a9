"""When a file counts as done: not if anything that enters its result differs."""

import os

from wks_segment.batch import Outcome, content_of, key_of


def test_a_key_is_of_path_state_and_settings(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0")
    key = key_of(path, ["learn", "--segments=4"])
    assert key_of(path, ["learn", "--segments=4"]) == key
    assert key_of(path, ["learn", "--segments=5"]) != key
    os.utime(path, (1, 1))
    assert key_of(path, ["learn", "--segments=4"]) != key


def test_the_content_of_a_folder_is_that_of_its_models(tmp_path):
    (tmp_path / "a.json").write_text("one")
    content = content_of(tmp_path)
    (tmp_path / "report.html").write_text("written by a batch")
    assert content_of(tmp_path) == content
    (tmp_path / "b.json").write_text("two")
    assert content_of(tmp_path) != content
    assert content_of(tmp_path / "a.json") == content


def test_a_line_is_read_again_and_half_a_line_is_none():
    outcome = Outcome("/in/a.obj", "a", "key", "done", outputs={"--model": "ä.json"}, result={"score": float("inf")})
    line = outcome.line()
    assert "\n" not in line
    assert Outcome.of_line(line) == Outcome(
        "/in/a.obj", "a", "key", "done", outputs={"--model": "ä.json"}, result={"score": None}
    )
    for damaged in (line[:-9], "", "[]", '{"input": 3}', "null"):
        assert Outcome.of_line(damaged) is None
