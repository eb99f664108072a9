"""A batch: a failing file costs only itself, nothing is lost, done twice or overwritten."""

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import lines
from full_disk import files_end_at

from wks_segment.batch import BatchError, Limits, Outcome, Program, merge_logs
from wks_segment.batch.results_log import ResultsLog, read_log
from wks_segment.core.progress import Progress
from wks_segment.interruption import Interrupted, interruptible

QUIET = Progress()


def results(folder):
    return {path.name for path in folder.glob("*.txt")}


def test_each_file_is_done_and_logged(batch, tmp_path):
    reports = []
    progress = Progress(lambda stage, share: reports.append((stage, share)))
    result = batch({"a": "one", "b": "two", "c": "three"}).run(progress)
    assert (result["files"], result["done"], result["now"], result["failed"]) == (3, 3, 3, {})
    assert results(tmp_path / "out") == {"a.txt", "b.txt", "c.txt"}
    listed = {line["name"]: line for line in lines(tmp_path / "out")}
    assert listed["a"]["outputs"] == {"--out": "a.txt"}
    assert listed["a"]["result"] == {"segments": 3, "warnings": ["<a> warning"]}
    assert listed["a"]["seconds"] > 0
    assert [share for _, share in reports] == pytest.approx([0, 1 / 3, 2 / 3, 1])
    assert "left" in reports[1][0]
    assert not (tmp_path / "out" / ".unfinished").exists()


def test_one_process_runs_all_files_in_one_child(batch, tmp_path):
    batch({str(i): "text" for i in range(6)}, processes=1).run(QUIET)
    texts = [(tmp_path / "out" / f"{i}.txt").read_text().split() for i in range(6)]
    assert len({pid for _, pid, _ in texts}) == 1
    assert sorted(int(number) for _, _, number in texts) == [1, 2, 3, 4, 5, 6]


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
def test_a_failing_file_costs_only_itself(batch, tmp_path, text, reason):
    limits = Limits(1.0 if "sleep" in text else 20.0)
    result = batch({"a": "one", "bad": text, "b": "two", "c": "three"}, processes=1, limits=limits).run(QUIET)
    assert result["done"] == 3
    assert list(result["failed"]) == [str(tmp_path / "in" / "bad")]
    assert reason in result["failed"][str(tmp_path / "in" / "bad")]
    assert results(tmp_path / "out") == {"a.txt", "b.txt", "c.txt"}


def test_the_reason_of_a_crash_quotes_what_the_child_printed(batch, tmp_path):
    batch({"bad": "crash"}).run(QUIET)
    assert "something is wrong" in lines(tmp_path / "out")[0]["reason"]


def test_a_child_with_too_much_memory_is_ended(batch, tmp_path):
    result = batch({"a": "one", "bad": "eat"}, limits=Limits(50.0, 300_000_000)).run(QUIET)
    assert "more than 0.3 GB of memory" in result["failed"][str(tmp_path / "in" / "bad")]
    assert result["done"] == 1


def test_a_crash_after_other_files_is_retried_in_a_new_process(batch):
    result = batch({"a": "one", "b": "crash if not first"}, processes=1).run(QUIET)
    assert result["failed"] == {}


def test_a_missing_output_is_a_failure(batch, tmp_path):
    result = batch({"a": "one"}, outputs={"--other": "a.txt"}).run(QUIET)
    assert "it was not written: a.txt" in result["failed"][str(tmp_path / "in" / "a")]


def test_additional_files_of_a_command_are_kept(batch, tmp_path):
    batch({"a": "one"}, settings=["--beside"]).run(QUIET)
    assert (tmp_path / "out" / "a.mtl").read_text() == "beside"
    assert lines(tmp_path / "out")[0]["outputs"] == {"--out": "a.txt", "a.mtl": "a.mtl"}


def test_resume_runs_only_unfinished_files(batch, tmp_path):
    texts = {"a": "one", "b": "two", "bad": "refuse"}
    batch(texts).run(QUIET)
    before = {name: (tmp_path / "out" / name).read_text() for name in results(tmp_path / "out")}
    (tmp_path / "out" / "b.txt").unlink()
    with open(tmp_path / "out" / "batch.jsonl", "a") as file:
        file.write('{"input": "half a li')
    result = batch(texts | {"new": "three"}, resume=True).run(QUIET)
    assert (result["files"], result["done"], result["now"]) == (4, 3, 2)
    assert list(result["failed"]) == [str(tmp_path / "in" / "bad")]
    assert (tmp_path / "out" / "a.txt").read_text() == before["a.txt"]
    assert (tmp_path / "out" / "b.txt").read_text() != before["b.txt"]
    assert sorted(line["name"] for line in lines(tmp_path / "out")) == ["a", "b", "bad", "new"]
    assert batch(texts, resume=True).run(QUIET)["now"] == 0
    assert batch(texts, resume=True, retry=True).run(QUIET)["now"] == 1


def test_a_batch_killed_before_it_moved_a_result_is_resumed(batch, tmp_path):
    batch({"a": "one", "b": "two"}).run(QUIET)
    out, (line, _) = tmp_path / "out", lines(tmp_path / "out")
    place = out / ".unfinished" / "batch.jsonl" / line["place"]
    place.mkdir(parents=True)
    (out / line["outputs"]["--out"]).rename(place / line["outputs"]["--out"])
    assert batch({"a": "one", "b": "two"}, resume=True).run(QUIET)["now"] == 0
    assert results(out) == {"a.txt", "b.txt"}
    assert not (out / ".unfinished").exists()


def test_what_killed_children_left_beside_scenes_is_removed(batch, tmp_path):
    """And nothing of another part of the batch, which may be running."""
    outputs = {"--output": "inner/{}.txt"}
    jobs = batch({"a": "one", "b": "two"}, outputs=outputs).jobs
    batch({"a": "one", "b": "two"}, outputs=outputs, part=(1, 2)).run(QUIET)
    left = [tmp_path / "out" / "inner" / f".wks_segment-{job.key}-abc.blend@" for job in jobs]
    for path in left:
        path.write_text("half a scene")
    assert batch({"a": "one", "b": "two"}, outputs=outputs, part=(1, 2), resume=True).run(QUIET)["now"] == 0
    assert [path.exists() for path in left] == [False, True]


def test_changed_files_and_settings_are_run_again(batch, tmp_path):
    batch({"a": "one", "b": "two"}).run(QUIET)
    assert batch({"a": "other", "b": "two"}, resume=True).run(QUIET)["now"] == 1
    assert (tmp_path / "out" / "a.txt").read_text().startswith("other")
    assert batch({"a": "other", "b": "two"}, settings=["--more"], resume=True).run(QUIET)["now"] == 2


def test_a_folder_with_other_files_is_refused(batch, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a.txt").write_text("mine")
    with pytest.raises(BatchError, match=r"not empty.*--resume"):
        batch({"a": "one"}).run(QUIET)
    with pytest.raises(BatchError, match="no batch that could be continued"):
        batch({"a": "one"}, resume=True).run(QUIET)
    assert (tmp_path / "out" / "a.txt").read_text() == "mine"


def test_a_file_that_is_not_from_the_batch_is_not_overwritten(batch, tmp_path):
    batch({"a": "one"}).run(QUIET)
    (tmp_path / "out" / "b.txt").write_text("mine")
    with pytest.raises(BatchError, match=r"b\.txt: the file exists and is not from this batch"):
        batch({"a": "one", "b": "two"}, resume=True).run(QUIET)
    assert (tmp_path / "out" / "b.txt").read_text() == "mine"


def test_the_result_of_another_file_is_not_overwritten(batch, tmp_path):
    batch({"a": "one"}, outputs={"--out": "same.txt"}).run(QUIET)
    with pytest.raises(
        BatchError, match=r"same\.txt: this is the result of .*a, and that of .*b would have the same name"
    ):
        batch({"b": "two"}, outputs={"--out": "same.txt"}, resume=True).run(QUIET)


def test_a_full_disk_ends_the_batch_and_a_plain_resume_goes_on(batch, tmp_path):
    texts = {"a": "one", "b": "fill", "c": "three", "d": "four"}
    with pytest.raises(BatchError, match=r"b: No space left on device: make room .*--resume"):
        batch(texts, processes=1).run(QUIET)
    assert [line["name"] for line in lines(tmp_path / "out")] == ["a"]
    assert not (tmp_path / "out" / ".unfinished").exists()
    result = batch(texts | {"b": "two"}, processes=1, resume=True).run(QUIET)
    assert (result["done"], result["now"], result["failed"]) == (4, 3, {})


def test_a_disk_that_is_filled_by_results_and_log(batch, tmp_path, small_disk):
    """Whatever does not fit first: what is listed as done is there and whole, and nothing else is."""
    texts = {f"{i:03d}": "x" * 5000 for i in range(40)}
    disk = small_disk(128)
    out = disk / "out"
    with pytest.raises(BatchError, match="make room on the disk"):
        batch(texts, folder=out).run(QUIET)
    done = [line["name"] for line in lines(out)]
    assert 5 < len(done) < 40
    assert sorted(path.stem for path in out.glob("*.txt")) == sorted(done)
    for name in done:
        assert (out / f"{name}.txt").read_text().startswith(texts[name])
    assert {path.name for path in out.iterdir()} <= {f"{name}.txt" for name in done} | {"batch.jsonl", "report.html"}
    subprocess.run(["mount", "-o", "remount,size=2M", disk], check=True)
    result = batch(texts, folder=out, resume=True).run(QUIET)
    assert (result["done"], result["now"]) == (40, 40 - len(done))


def test_a_line_that_does_not_fit_leaves_the_log_as_it_was(tmp_path):
    outcome = Outcome("/in/a", "a", "key", "failed", "why " * 100)
    with ResultsLog(tmp_path / "batch.jsonl") as log:
        log.add(outcome)
        size = log.path.stat().st_size
        with files_end_at(size + 100), pytest.raises(OSError, match=r"batch\.jsonl"):
            log.add(replace(outcome, input="/in/b"))
        assert log.path.stat().st_size == size
        log.add(replace(outcome, input="/in/c"))
    assert list(read_log(tmp_path / "batch.jsonl")) == ["/in/a", "/in/c"]


def test_a_folder_for_temporary_files_that_is_full(batch, small_disk, monkeypatch):
    disk = small_disk(64)
    (disk / "filler").write_bytes(bytes(2**16 - 4096))
    monkeypatch.setattr("tempfile.tempdir", str(disk))
    with pytest.raises(BatchError, match="make room on the disk"):
        batch({"a": "one"}).run(QUIET)


def test_a_folder_that_is_deleted_while_the_batch_runs(batch, tmp_path):
    def delete(stage, share):
        if share > 0:  # at once: a child writes to it meanwhile
            (tmp_path / "out").rename(tmp_path / "gone")

    with pytest.raises(BatchError, match="out: the folder was deleted while the batch was running"):
        batch({"a": "one", "b": "two", "c": "three"}, processes=1).run(Progress(delete))


def test_folders_that_cannot_be_used(batch, tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(BatchError, match="link: this is a link to a folder that does not exist"):
        batch({"a": "one"}, folder=tmp_path / "link").run(QUIET)
    if Path("/proc/self").is_dir():
        with pytest.raises(BatchError, match=r"/proc/self/out: .*take another --output"):
            batch({"a": "one"}, folder=Path("/proc/self/out")).run(QUIET)


@pytest.mark.skipif(sys.platform == "win32", reason="logs are not locked on Windows")
def test_two_batches_do_not_write_to_one_log(batch):
    first = threading.Thread(target=batch({"slow": "sleep 3"}).run, args=(QUIET,))
    first.start()
    time.sleep(1)
    with pytest.raises(BatchError, match="another batch writes to it"):
        batch({"slow": "sleep 3"}, resume=True).run(QUIET)
    first.join()


def test_the_logs_of_parts_are_merged(batch, tmp_path):
    texts = {"a": "one", "b": "two", "c": "refuse", "d": "four", "e": "five"}
    counts = [batch(texts, part=(i, 2), resume=True).run(QUIET)["files"] for i in (1, 2)]
    assert counts == [3, 2]
    assert {path.name for path in (tmp_path / "out").glob("*.jsonl")} == {"batch.1-of-2.jsonl", "batch.2-of-2.jsonl"}
    result = merge_logs(tmp_path / "out")
    assert (result["files"], result["done"]) == (5, 4)
    assert len(lines(tmp_path / "out")) == 5
    assert batch(texts, resume=True).run(QUIET)["now"] == 0
    with pytest.raises(BatchError, match="no batch in this folder"):
        merge_logs(tmp_path)


def test_a_program_that_does_not_start_is_named(batch, tmp_path):
    for program in (Program(("/no/such/program",)), Program((sys.executable, "-c", "print('so it is'); exit(4)"))):
        with pytest.raises(BatchError, match=r"it could not be started|exit code 4; it printed: so it is"):
            batch({"a": "one"}, program=program).run(QUIET)
    assert batch({"a": "one"}).run(QUIET)["done"] == 1, "a batch that did not start leaves a file behind"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signals")
@pytest.mark.parametrize("kills", [2, 3])
def test_a_child_that_is_killed_while_it_starts_is_started_again(batch, tmp_path, kills):
    """Somebody or the system may do that; a program that can never start ends the batch all the same."""
    fake = " ".join(batch({"a": "one"}).program.command)
    (tmp_path / "start.sh").write_text(
        f'echo >> "$0.count"; [ $(wc -l < "$0.count") -gt {kills} ] || kill -9 $$; exec {fake} "$1"'
    )
    program = Program(("sh", str(tmp_path / "start.sh")))
    if kills < 3:
        assert batch({"a": "one"}, program=program, processes=1).run(QUIET)["done"] == 1
    else:
        with pytest.raises(BatchError, match=r"no child process could be started by .*SIGKILL"):
            batch({"a": "one"}, program=program, processes=1).run(QUIET)


def test_a_part_without_files_is_refused(batch):
    with pytest.raises(BatchError, match="--part 3/3: there are only 2 files"):
        batch({"a": "one", "b": "two"}, part=(3, 3)).run(QUIET)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has other signals")
@pytest.mark.parametrize("before", [signal.default_int_handler, signal.SIG_IGN], ids=["usual", "ignored"])
def test_ctrl_c_ends_the_children_and_says_how_to_continue(batch, tmp_path, before, request):
    """Also where the shell ignores it, as after `&` in a script."""
    outside = signal.signal(signal.SIGINT, before)
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, outside or signal.SIG_DFL))
    pids = []

    def interrupt(stage, share):
        if share > 0:
            pids.append(int((tmp_path / "out" / "a.txt").read_text().split()[1]))
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(Interrupted, match=r"interrupted, with 1 of 3 files done.*--resume"), interruptible():
        batch({"a": "one", "b": "sleep 50", "c": "sleep 50"}).run(Progress(interrupt))
    assert signal.getsignal(signal.SIGINT) is before
    with pytest.raises(ProcessLookupError):
        os.kill(pids[0], 0)
    assert len(lines(tmp_path / "out")) == 1
    assert batch({"a": "one", "b": "two", "c": "three"}, resume=True).run(QUIET)["now"] == 2


def test_the_report_lists_failures_first_and_escapes_names(batch, tmp_path):
    outputs = {"--out": "{}.txt", "--out2": "{} &.png"}
    batch({"<b>": "one", "z": "refuse"}, outputs=outputs).run(QUIET)
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.index("there is no mesh") < page.index("3 segments")
    assert "<b>" not in page
    assert "&lt;b&gt;" in page
    assert 'src="%3Cb%3E%20%26.png"' in page
    assert "&lt;a&gt; warning" in page
    assert str(tmp_path) not in page.replace(f'title="{tmp_path}', "").replace(str(tmp_path / "in"), "")
