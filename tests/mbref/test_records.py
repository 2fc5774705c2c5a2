"""Record files: what is appended is there; what is no record is left alone; a full disk costs nothing."""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import signal
import time
from pathlib import Path

import pytest

from mbref import records
from mbref.cli import main
from mbref.records import RecordsError, append, stored, strict_json

NO_DISK = pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")


def refused(constant: str) -> float:
    raise AssertionError(f"{constant} is no JSON")


def test_lines_are_strict_json_and_come_back(tmp_path: Path):
    path = tmp_path / "runs.jsonl"
    append(path, {"key": "a", "numbers": [math.nan, math.inf, -math.inf, 1.0], "name": "Infinity"})
    line = json.loads(path.read_text(), parse_constant=refused)
    assert line == {"key": "a", "numbers": [None, math.inf, -math.inf, 1.0], "name": "Infinity"}
    assert stored(path) == {"a": line}


def test_the_last_record_of_a_key_counts(tmp_path: Path):
    path = tmp_path / "runs.jsonl"
    for value in (1, 2):
        append(path, {"key": "a", "value": value})
    assert stored(path)["a"]["value"] == 2


def test_foreign_lines_are_told_by_number_and_left(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "runs.jsonl"
    lines = [
        '{"key": "a"}',
        "notes",
        '{"key": 1}',
        '{"key": "n", "x": NaN}',
        "[1]",
        '{"key": "b"}',
        "[" * 9000,
    ]
    path.write_text("\n".join(lines) + "\n")
    assert set(stored(path)) == {"a", "b"}
    assert capsys.readouterr().err == f"{path}: line 2, 3, 4, 5, 7 holds no record and was left unchanged\n"
    assert path.read_text().splitlines() == lines


def test_a_line_cut_short_is_taken_off_and_no_other(tmp_path: Path):
    path = tmp_path / "runs.jsonl"
    path.write_text('{"key": "a"}\n{"key": "cut sho')
    assert set(stored(path)) == {"a"}
    append(path, {"key": "b"})
    assert set(records.opened(path)) == {"a", "b"}
    assert path.read_text() == '{"key": "a"}\n{"key": "b"}\n'


@pytest.mark.parametrize("text", ["my only copy", "first\nsecond\n", "{}\n", "\x00\xff"], ids=repr)
def test_a_file_of_something_else_is_refused_and_not_touched(text: str, tmp_path: Path):
    path = tmp_path / "letter.txt"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(RecordsError, match=r"letter\.txt: holds no records"):
        stored(path)
    assert path.read_text(encoding="latin-1") == text


@pytest.mark.parametrize(
    ("out", "says"), [("letter.txt", "holds no records"), ("no/folder", "no folder"), (".", "is a folder")]
)
def test_a_bad_file_of_results_is_bad_input(out: str, says: str, tmp_path: Path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("letter.txt").write_text("my only copy")
    few = [
        "--vary",
        "gravity[1]=0:1",
        "--count",
        "2",
        "--workers",
        "1",
        "--samples",
        "2",
        "--duration",
        "1e-3",
    ]
    try:
        status = main(["ensemble", "four_bar", *few, "--out", out])
    except SystemExit as refused:
        status = refused.code
    error = capsys.readouterr().err
    assert status == 2 and says in error and "Traceback" not in error, error
    assert Path("letter.txt").read_text() == "my only copy"


@NO_DISK
def test_a_full_disk_is_an_error():
    with pytest.raises(OSError, match="No space left"):
        append("/dev/full", {"key": "a"})


def test_a_write_that_fails_half_way_leaves_whole_lines(tmp_path: Path):
    """The limit of a file's size stands for a disk that fills up."""
    resource = pytest.importorskip("resource")
    path = tmp_path / "runs.jsonl"
    append(path, {"key": "a"})
    size = path.stat().st_size

    def fill() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size + 5, size + 5))
        try:
            append(path, {"key": "b", "long": "x" * 100})
        except OSError:
            os._exit(7)

    process = multiprocessing.get_context("fork").Process(target=fill)
    process.start()
    process.join()
    assert process.exitcode == 7, "the write was to fail"
    assert path.read_text() == '{"key": "a"}\n'


def write_for_ever(path: str) -> None:
    """Records one after another, those left out that the file has."""
    for k in range(len(stored(path)), 1_000_000):
        append(path, {"key": str(k), "long": "x" * 5000})


def test_killed_writers_lose_nothing_and_write_nothing_twice(tmp_path: Path):
    path = tmp_path / "runs.jsonl"
    for _ in range(5):
        process = multiprocessing.get_context("fork").Process(target=write_for_ever, args=(str(path),))
        process.start()
        before = path.stat().st_size if path.exists() else 0
        while not path.exists() or path.stat().st_size < before + 50_000:
            time.sleep(0.001)
        process.kill()
        process.join()
    kept = stored(path)
    lines = [json.loads(line)["key"] for line in path.read_text().splitlines()]
    assert len(kept) > 50 and lines == list(kept) == [str(k) for k in range(len(kept))]


def test_text_for_any_reader():
    assert strict_json({"a": (1, math.nan), "b": [math.inf]}) == '{"a": [1, null], "b": [1e999]}'
