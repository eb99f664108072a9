"""A batch: each file costs no more than itself, nothing is lost, nothing is done twice or written over."""

import os
import signal
import sys
import threading
import time

import pytest
from command_line import lines, quiet

from wks_segment.batch import BatchError, Limits, Program, merged


def results(folder):
    return {path.name for path in folder.glob("*.txt")}


def test_each_file_is_done_and_listed(batch, tmp_path):
    said = []
    result = batch({"a": "one", "b": "two", "c": "three"}).run(lambda stage, share: said.append((stage, share)))
    assert (result["files"], result["done"], result["now"], result["failed"]) == (3, 3, 3, {})
    assert results(tmp_path / "out") == {"a.txt", "b.txt", "c.txt"}
    listed = {line["name"]: line for line in lines(tmp_path / "out")}
    assert listed["a"]["outputs"] == {"--out": "a.txt"}
    assert listed["a"]["result"] == {"segments": 3, "warnings": ["<a> warning"]}
    assert listed["a"]["seconds"] > 0
    assert [share for _, share in said] == pytest.approx([0, 1 / 3, 2 / 3, 1])
    assert "left" in said[1][0]
    assert not (tmp_path / "out" / ".unfinished").exists()


def test_children_live_on_and_are_as_many_as_asked_for(batch, tmp_path):
    batch({str(i): "text" for i in range(6)}, processes=1).run(quiet)
    told = [(tmp_path / "out" / f"{i}.txt").read_text().split() for i in range(6)]
    assert len({pid for _, pid, _ in told}) == 1
    assert sorted(int(number) for _, _, number in told) == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("crash", "SIGKILL"),
        ("leave", "exit code 7"),
        ("raise", "RuntimeError: unforeseen"),
        ("refuse", "there is no mesh in this file"),
        ("sleep 100", "more than 1 seconds"),
    ],
)
def test_what_fails_costs_only_itself(batch, tmp_path, text, reason):
    limits = Limits(1.0 if "sleep" in text else 20.0)
    result = batch({"a": "one", "bad": text, "b": "two", "c": "three"}, processes=1, limits=limits).run(quiet)
    assert result["done"] == 3
    assert list(result["failed"]) == [str(tmp_path / "in" / "bad")]
    assert reason in result["failed"][str(tmp_path / "in" / "bad")]
    assert results(tmp_path / "out") == {"a.txt", "b.txt", "c.txt"}


def test_the_last_words_of_a_crash_are_listed(batch, tmp_path):
    batch({"bad": "crash"}).run(quiet)
    assert "something is wrong" in lines(tmp_path / "out")[0]["reason"]


@pytest.mark.skipif(sys.platform != "linux", reason="memory is watched on Linux")
def test_what_takes_too_much_memory_is_ended(batch, tmp_path):
    result = batch({"a": "one", "bad": "eat"}, limits=Limits(50.0, 300_000_000)).run(quiet)
    assert "more than 0.3 GB of memory" in result["failed"][str(tmp_path / "in" / "bad")]
    assert result["done"] == 1


def test_a_crash_for_which_earlier_files_may_be_to_blame_is_tried_in_a_fresh_process(batch):
    result = batch({"a": "one", "b": "crash if not first"}, processes=1).run(quiet)
    assert result["failed"] == {}


def test_what_was_not_written_failed(batch, tmp_path):
    result = batch({"a": "one"}, outputs={"--other": "a.txt"}).run(quiet)
    assert "it was not written: a.txt" in result["failed"][str(tmp_path / "in" / "a")]


def test_files_beside_an_output_come_along(batch, tmp_path):
    batch({"a": "one"}, settings=["--beside"]).run(quiet)
    assert (tmp_path / "out" / "a.mtl").read_text() == "beside"
    assert lines(tmp_path / "out")[0]["outputs"] == {"--out": "a.txt", "a.mtl": "a.mtl"}


def test_resume_does_only_what_is_not_done(batch, tmp_path):
    texts = {"a": "one", "b": "two", "bad": "refuse"}
    batch(texts).run(quiet)
    before = {name: (tmp_path / "out" / name).read_text() for name in results(tmp_path / "out")}
    (tmp_path / "out" / "b.txt").unlink()
    with open(tmp_path / "out" / "batch.jsonl", "a") as file:
        file.write('{"input": "half a li')
    result = batch(texts | {"new": "three"}, resume=True).run(quiet)
    assert (result["files"], result["done"], result["now"]) == (4, 3, 2)
    assert list(result["failed"]) == [str(tmp_path / "in" / "bad")]
    assert (tmp_path / "out" / "a.txt").read_text() == before["a.txt"]
    assert (tmp_path / "out" / "b.txt").read_text() != before["b.txt"]
    assert sorted(line["name"] for line in lines(tmp_path / "out")) == ["a", "b", "bad", "new"]
    assert batch(texts, resume=True).run(quiet)["now"] == 0
    assert batch(texts, resume=True, again=True).run(quiet)["now"] == 1


def test_a_batch_that_was_killed_between_list_and_files_goes_on(batch, tmp_path):
    batch({"a": "one", "b": "two"}).run(quiet)
    out, (line, _) = tmp_path / "out", lines(tmp_path / "out")
    place = out / ".unfinished" / "batch.jsonl" / line["place"]
    place.mkdir(parents=True)
    (out / line["outputs"]["--out"]).rename(place / line["outputs"]["--out"])
    assert batch({"a": "one", "b": "two"}, resume=True).run(quiet)["now"] == 0
    assert results(out) == {"a.txt", "b.txt"}
    assert not (out / ".unfinished").exists()


def test_what_changed_is_done_again(batch, tmp_path):
    batch({"a": "one", "b": "two"}).run(quiet)
    assert batch({"a": "other", "b": "two"}, resume=True).run(quiet)["now"] == 1
    assert (tmp_path / "out" / "a.txt").read_text().startswith("other")
    assert batch({"a": "other", "b": "two"}, settings=["--more"], resume=True).run(quiet)["now"] == 2


def test_a_folder_with_something_in_it_is_refused(batch, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a.txt").write_text("mine")
    with pytest.raises(BatchError, match=r"not empty.*--resume"):
        batch({"a": "one"}).run(quiet)
    with pytest.raises(BatchError, match="no batch that could be resumed"):
        batch({"a": "one"}, resume=True).run(quiet)
    assert (tmp_path / "out" / "a.txt").read_text() == "mine"


def test_a_file_that_is_not_from_the_batch_is_not_written_over(batch, tmp_path):
    batch({"a": "one"}).run(quiet)
    (tmp_path / "out" / "b.txt").write_text("mine")
    with pytest.raises(BatchError, match=r"b\.txt: the file is there, but not from this batch"):
        batch({"a": "one", "b": "two"}, resume=True).run(quiet)
    assert (tmp_path / "out" / "b.txt").read_text() == "mine"


def test_the_result_of_another_file_is_not_written_over(batch, tmp_path):
    batch({"a": "one"}, outputs={"--out": "same.txt"}).run(quiet)
    with pytest.raises(BatchError, match=r"same\.txt: this is what came of .*a, and .*b would have the same name"):
        batch({"b": "two"}, outputs={"--out": "same.txt"}, resume=True).run(quiet)


@pytest.mark.skipif(sys.platform == "win32", reason="lists are not locked on Windows")
def test_two_batches_do_not_write_to_one_list(batch):
    first = threading.Thread(target=batch({"slow": "sleep 3"}).run, args=(quiet,))
    first.start()
    time.sleep(1)
    with pytest.raises(BatchError, match="another batch is at work"):
        batch({"slow": "sleep 3"}, resume=True).run(quiet)
    first.join()


def test_parts_of_a_batch_are_put_together(batch, tmp_path):
    texts = {"a": "one", "b": "two", "c": "refuse", "d": "four", "e": "five"}
    counts = [batch(texts, part=(i, 2), resume=True).run(quiet)["files"] for i in (1, 2)]
    assert counts == [3, 2]
    assert {path.name for path in (tmp_path / "out").glob("*.jsonl")} == {"batch.1-of-2.jsonl", "batch.2-of-2.jsonl"}
    result = merged(tmp_path / "out")
    assert (result["files"], result["done"]) == (5, 4)
    assert len(lines(tmp_path / "out")) == 5
    assert batch(texts, resume=True).run(quiet)["now"] == 0
    with pytest.raises(BatchError, match="no batch in this folder"):
        merged(tmp_path)


def test_a_program_that_does_not_start_is_named(batch, tmp_path):
    for program in (Program(("/no/such/program",)), Program((sys.executable, "-c", "print('so it is'); exit(4)"))):
        with pytest.raises(BatchError, match=r"it could not be started|exit code 4; it printed: so it is"):
            batch({"a": "one"}, program=program).run(quiet)
    assert batch({"a": "one"}).run(quiet)["done"] == 1, "what did not begin leaves nothing behind"


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent otherwise there")
def test_ctrl_c_ends_the_children_and_says_how_to_go_on(batch, tmp_path):
    pids = []

    def interrupt(stage, share):
        if share > 0:
            pids.append(int((tmp_path / "out" / "a.txt").read_text().split()[1]))
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(BatchError, match=r"ended by the user with 1 of 3 files done.*--resume"):
        batch({"a": "one", "b": "sleep 50", "c": "sleep 50"}).run(interrupt)
    with pytest.raises(ProcessLookupError):
        os.kill(pids[0], 0)
    assert len(lines(tmp_path / "out")) == 1
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert batch({"a": "one", "b": "two", "c": "three"}, resume=True).run(quiet)["now"] == 2


def test_the_report_has_failures_first_and_nothing_of_a_name_is_html(batch, tmp_path):
    outputs = {"--out": "{}.txt", "--out2": "{} &.png"}
    batch({"<b>": "one", "z": "refuse"}, outputs=outputs).run(quiet)
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.index("there is no mesh") < page.index("3 segments")
    assert "<b>" not in page
    assert "&lt;b&gt;" in page
    assert 'src="%3Cb%3E%20%26.png"' in page
    assert "&lt;a&gt; warning" in page
    assert str(tmp_path) not in page.replace(f'title="{tmp_path}', "").replace(str(tmp_path / "in"), "")
