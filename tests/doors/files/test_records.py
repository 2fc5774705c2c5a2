"""Record files: appended records are whole, other lines stay, a full disk loses nothing."""

import json
import math
import multiprocessing
import os
import signal
from pathlib import Path

import pytest

from mbref import records
from mbref.cli import main
from mbref.records import RecordsError, append, stored


def test_line_of_a_record_is_strict_json_and_read_back(tmp_path: Path):
    """RFC 8259 knows neither NaN nor Infinity: NaN is written as null, infinity as 1e999. A word of Python's
    own for them would raise KeyError."""
    path = tmp_path / "runs.jsonl"
    append(path, {"key": "a", "numbers": [math.nan, math.inf, -math.inf, 1.0], "name": "Infinity"})
    line = json.loads(path.read_text(), parse_constant={}.__getitem__)
    assert line == {"key": "a", "numbers": [None, math.inf, -math.inf, 1.0], "name": "Infinity"}
    assert stored(path) == {"a": line}


def test_last_record_of_a_key_replaces_earlier_ones(tmp_path: Path):
    """Two records with the key "a" are appended, and the second is read."""
    path = tmp_path / "runs.jsonl"
    for value in (1, 2):
        append(path, {"key": "a", "value": value})
    assert stored(path)["a"]["value"] == 2


def test_lines_that_are_no_records_are_reported_by_number_and_kept(tmp_path, capsys):
    """Text, a key that is no text, NaN and a list between two records; then brackets too deep to parse."""
    path = tmp_path / "runs.jsonl"
    middle = ["notes", '{"key": 1}', '{"key": "n", "x": NaN}', "[1]"]
    lines = ['{"key": "a"}', *middle, '{"key": "b"}', "[" * 9000]
    path.write_text("\n".join(lines) + "\n")
    assert set(stored(path)) == {"a", "b"}
    assert capsys.readouterr().err == f"{path}: line 2, 3, 4, 5, 7 holds no record and was left unchanged\n"
    assert path.read_text().splitlines() == lines


def test_only_a_line_cut_short_at_the_end_is_removed(tmp_path: Path):
    """``stored`` leaves it out, and a record that is appended replaces it."""
    path = tmp_path / "runs.jsonl"
    path.write_text('{"key": "a"}\n{"key": "cut sho')
    assert set(stored(path)) == {"a"}
    append(path, {"key": "b"})
    assert set(records.opened(path)) == {"a", "b"}
    assert path.read_text() == '{"key": "a"}\n{"key": "b"}\n'


@pytest.mark.parametrize("text", ["my only copy", "first\nsecond\n", "{}\n", "\x00\xff"], ids=repr)
def test_file_without_records_is_refused_and_not_touched(text: str, tmp_path: Path):
    """Text with and without a line end, an empty JSON object, and bytes that are no text."""
    path = tmp_path / "letter.txt"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(RecordsError, match=r"letter\.txt: holds no records"):
        stored(path)
    assert path.read_text(encoding="latin-1") == text


@pytest.mark.parametrize(
    ("out", "says"), [("letter.txt", "holds no records"), ("no/folder", "no folder"), (".", "is a folder")]
)
def test_command_refuses_a_file_for_results_that_holds_none_or_cannot_be_written(
    out: str, says: str, tmp_path: Path, capsys, monkeypatch
):
    """`mbref ensemble --out` names a letter, which stays, a file in a missing folder, or a folder."""
    monkeypatch.chdir(tmp_path)
    Path("letter.txt").write_text("my only copy")
    few = "--vary gravity[1]=0:1 --count 2 --workers 1 --samples 2 --duration 1e-3"
    try:
        status = main(["ensemble", "four_bar", *few.split(), "--out", out])
    except SystemExit as ended:
        status = ended.code
    error = capsys.readouterr().err
    assert status == 2 and says in error and "Traceback" not in error, error
    assert Path("letter.txt").read_text() == "my only copy"


def test_write_that_fails_half_way_raises_an_error_and_leaves_whole_lines(tmp_path: Path):
    """A limit of the file's size, 5 bytes above its present size, acts like a disk that fills up."""
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


def test_device_without_an_end_is_no_scene_holds_no_records_and_refuses_new_ones(capsys):
    """/dev/full gives zeros for ever, and is full for each byte that is written to it."""
    assert main(["draw", "/dev/full"]) == 2
    assert capsys.readouterr().err.startswith("/dev/full: cannot be read: File too large")
    assert records.opened("/dev/full") == {}
    with pytest.raises(OSError, match="No space left"):
        append("/dev/full", {"key": "a"})
