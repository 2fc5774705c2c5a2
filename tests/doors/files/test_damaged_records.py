"""Damaged records of a report: one sentence that names the file, and exit status 2."""

import copy
import json
from pathlib import Path
from typing import Any

import pytest

from crosscheck.cli import main as crosscheck
from mbref.scenes import SCENES
from reports.__main__ import main as report
from tests.fuzz.broken_files import RECORD

FOREIGN = [b"null\n", b"[" * 100_000 + b"\n", b"\xff\xfe\x00\n", b"[]\n", b'{"key": 1}\n', b"\x1b[31m\n"]
FAULTS: list[tuple[str, Any]] = [
    ("outcome", None),
    ("outcome", "FLYING"),
    ("metrics", {"error": "small"}),
    ("cost", {}),
    ("times", "soon"),
    ("scene", 1),
    ("asked", {"engine": "mbref"}),
    ("versions", []),
    ("commit", [[1]]),
    ("bodies", {"crank": {"position": [[0.0, 0.0]] * 2, "orientation": []}}),
    ("reactions", {"A": [["far"] * 6] * 2}),
    ("angles", {"A": [10**400, 0.0]}),
    ("crossings", [{"time": 0.1}]),
]


def folder(place: Path, lines: bytes) -> Path:
    """Make the folder of a report with these records."""
    (place / "scenes").mkdir(parents=True)
    SCENES["four_bar"]().save(place / "scenes" / "four_bar.toml")
    (place / "records.jsonl").write_bytes(lines)
    return place


def record_with(field: str, value: Any = None) -> bytes:
    """Return a line of a right record in which a field has another value, or is missing."""
    record = copy.deepcopy(RECORD)
    record.pop(field, None)
    return json.dumps(record if value is None else {**record, field: value}).encode() + b"\n"


def refused(capsys: pytest.CaptureFixture[str], place: Path) -> str:
    """Return the message of `report --render`, which ends with status 2 and one sentence that names the
    file of records, as `crosscheck diff` must, too."""
    assert report(["--render", str(place)]) == 2
    rendering = capsys.readouterr().err
    assert crosscheck(["diff", str(place), str(place)]) == 2
    comparing = capsys.readouterr().err
    assert "Traceback" not in rendering + comparing and "\x1b" not in rendering + comparing
    assert rendering.count("\n") == comparing.count("\n") == 1
    assert "records.jsonl" in rendering and "records.jsonl" in comparing
    return rendering


@pytest.mark.parametrize("content", FOREIGN, ids=lambda content: ascii(content[:8]))
def test_records_file_of_other_content_is_named(content, tmp_path, capsys):
    """Null, deep or other JSON, no UTF-8, an escape character: `report --render` and `diff` refuse them."""
    assert "holds no records" in refused(capsys, folder(tmp_path / "r", content))


@pytest.mark.parametrize(("field", "value"), FAULTS, ids=lambda x: str(x)[:12])
def test_faulty_field_of_a_record_is_named(field, value, tmp_path, capsys):
    """The field is missing (None) or has a value of another kind; k1 is the record's key."""
    said = refused(capsys, folder(tmp_path / "r", record_with(field, value)))
    assert f"record 'k1': {field}" in said


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("reactions", {"A": [[0.0] * 6]}, "rows of A: 1, for 2 times"),
        ("scene", "lost", "no file of scenes/ has the name 'lost'"),
    ],
)
def test_record_whose_parts_do_not_fit_is_named(field, value, said, tmp_path, capsys):
    """Reactions at one of two times; a scene whose file is lost."""
    assert report(["--render", str(folder(tmp_path / "r", record_with(field, value)))]) == 2
    shown = capsys.readouterr().err
    assert "records.jsonl: record 'k1'" in shown and said in shown and shown.count("\n") == 1


@pytest.mark.parametrize("name", ["timings.jsonl", "truths.jsonl", "motions.jsonl", "conformance/x.json"])
def test_faulty_file_beside_right_records_is_named(name, tmp_path, capsys):
    """Its line has only a key and a scene."""
    place = folder(tmp_path / "r", record_with("seed", 0))
    (place / name).parent.mkdir(exist_ok=True)
    (place / name).write_text('{"key": "k1", "scene": "four_bar"}\n')
    assert report(["--render", str(place)]) == 2
    assert name in capsys.readouterr().err


@pytest.mark.parametrize(
    "content", [b"{", b"[" * 100_000, b"\xff\xfe\x00"], ids=lambda content: ascii(content[:8])
)
def test_verdicts_of_a_suite_that_are_no_json_are_named(content, tmp_path, capsys):
    place = folder(tmp_path / "r", record_with("seed", 0))
    (place / "conformance").mkdir()
    (place / "conformance" / "x.json").write_bytes(content)
    assert report(["--render", str(place)]) == 2
    assert "x.json: is not JSON" in capsys.readouterr().err


def test_closed_loops_and_convergence_name_the_missing_field_of_a_record(tmp_path, capsys):
    """The record lacks its cost."""
    faulty = tmp_path / "records.jsonl"
    faulty.write_bytes(record_with("cost"))
    for command in ("closed-loops", "convergence"):
        assert crosscheck([command, "--records", str(faulty)]) == 2
        assert "record 'k1': cost: field required" in capsys.readouterr().err


def test_records_of_another_mechanism_than_the_scene_file_are_named_and_not_left_out(tmp_path, capsys):
    """A record names its mechanism by a digest, here another one than that of the only scene."""
    place = folder(tmp_path / "report", record_with("mechanism", "0123456789abcdef"))
    assert report(["--render", str(place)]) == 2
    assert "records of four_bar are of another mechanism" in capsys.readouterr().err
