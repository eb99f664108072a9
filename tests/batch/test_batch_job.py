"""Keys of jobs, which differ if anything that the result depends on differs, and lines of the log."""

import os

from wks_segment.batch import Outcome, hash_models, job_key


def test_a_key_depends_on_file_and_settings(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0")
    key = job_key(path, ["learn", "--segments=4"])
    assert job_key(path, ["learn", "--segments=4"]) == key
    assert job_key(path, ["learn", "--segments=5"]) != key
    os.utime(path, (1, 1))
    assert job_key(path, ["learn", "--segments=4"]) != key


def test_the_hash_models_a_folder_is_that_of_its_models(tmp_path):
    (tmp_path / "a.json").write_text("one")
    content = hash_models(tmp_path)
    (tmp_path / "report.html").write_text("written by a batch")
    assert hash_models(tmp_path) == content
    (tmp_path / "b.json").write_text("two")
    assert hash_models(tmp_path) != content
    assert hash_models(tmp_path / "a.json") == content


def test_a_line_is_read_again_and_an_incomplete_one_is_skipped():
    outcome = Outcome("/in/a.obj", "a", "key", "done", outputs={"--model": "ä.json"}, result={"score": float("inf")})
    line = outcome.to_line()
    assert "\n" not in line
    assert Outcome.from_line(line) == Outcome(
        "/in/a.obj", "a", "key", "done", outputs={"--model": "ä.json"}, result={"score": None}
    )
    for damaged in (line[:-9], "", "[]", '{"input": 3}', "null"):
        assert Outcome.from_line(damaged) is None
