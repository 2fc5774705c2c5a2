"""Damaged records of a report: one sentence that names the file, and exit status 2."""

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crosscheck.cli import main as crosscheck
from crosscheck.study.truths import truth_record
from mbref.records import strict_json
from mbref.scenes import SCENES
from reports.__main__ import main as report
from reports.stored import groups
from tests.fuzz.broken_files import RECORD

FOREIGN = [b"null\n", b"[" * 100_000 + b"\n", b"\xff\xfe\x00\n", b"[]\n", b'{"key": 1}\n', b"\x1b[31m\n"]
FAULTS: list[tuple[str, Any]] = [
    *(("outcome", None), ("outcome", "FLYING"), ("metrics", {"error": "small"}), ("cost", {})),
    *(("times", "soon"), ("scene", 1), ("asked", {"engine": "mbref"}), ("versions", []), ("commit", [[1]])),
    ("bodies", {"crank": {"position": [[0.0, 0.0]] * 2, "orientation": []}}),
    *(("reactions", {"A": [["far"] * 6] * 2}), ("angles", {"A": [10**400, 0.0]})),
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
    """Return the message of `report --render`, one sentence with status 2, as `crosscheck diff`'s must be."""
    assert report(["--render", str(place)]) == 2
    rendering = capsys.readouterr().err
    assert crosscheck(["diff", str(place), str(place)]) == 2
    comparing = capsys.readouterr().err
    assert "Traceback" not in rendering + comparing and "\x1b" not in rendering + comparing
    assert rendering.count("\n") == comparing.count("\n") == 1
    assert "records.jsonl" in rendering and "records.jsonl" in comparing
    return rendering


@pytest.mark.parametrize("content", FOREIGN, ids=lambda content: ascii(content[:8]))
def test_file_without_any_record_is_refused_in_one_sentence_with_its_name(content, tmp_path, capsys):
    """FOREIGN are null, deeply nested, empty and foreign JSON, bytes that are no UTF-8, and an escape
    character. ``refused`` gives each file to two commands."""
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
        ("bodies", {}, "bodies: pictures require states of all bodies"),
        ("scene", "lost", "no file of scenes/ has the name 'lost'"),
    ],
)
def test_record_whose_parts_do_not_fit_is_named(field, value, said, tmp_path, capsys):
    """Reactions at one of two times; no states, which pictures need; a scene whose file is lost."""
    assert report(["--render", str(folder(tmp_path / "r", record_with(field, value)))]) == 2
    shown = capsys.readouterr().err
    assert "records.jsonl: record 'k1'" in shown and said in shown and shown.count("\n") == 1


LACKING = b'{"key": "k1", "scene": "four_bar"}\n'
UNMOVED = (
    b'{"key": "k1", "scene": "four_bar", "kind": "x", "bound": 0.0, "reason": "", "until": 0.1, '
    b'"both": true, "motion": {"times": [], "bodies": {}}}\n'
)


BESIDE = {
    "truth without bodies": ("truths.jsonl", UNMOVED, "record 'k1': bodies: are not the bodies of"),
    "no numbers in timings": ("timings.jsonl", LACKING, "record 'k1': seconds: field required"),
    "no truth": ("truths.jsonl", LACKING, "record 'k1': kind: field required"),
    "no motion": ("motions.jsonl", LACKING, "record 'k1': engine: field required"),
    "no verdicts": ("conformance/x.json", LACKING, "record 'k1': engine: field required"),
    "brace alone": ("conformance/x.json", b"{", "is not JSON"),
    "brackets too deep": ("conformance/x.json", b"[" * 100_000, "is not JSON"),
    "bytes that are no text": ("conformance/x.json", b"\xff\xfe\x00", "is not JSON"),
}


@pytest.mark.parametrize(("name", "content", "says"), BESIDE.values(), ids=BESIDE)
def test_faulty_file_beside_right_records_is_named_with_its_fault(name, content, says, tmp_path, capsys):
    """BESIDE has the name and the content of the file, and words of the fault. LACKING is a line with only a
    key and a scene, UNMOVED a truth without the motion of its bodies; other contents are no JSON."""
    place = folder(tmp_path / "r", record_with("seed", 0))
    (place / name).parent.mkdir(exist_ok=True)
    (place / name).write_bytes(content)
    assert report(["--render", str(place)]) == 2
    said = capsys.readouterr().err
    assert name in said and says in said and said.count("\n") == 1


GROUP = {
    **{"within": 1e-5, "ended": {"lu": "", "qr": ""}, "seconds": {"lu": 0.1, "qr": 0.1}, "off": {}},
    "pairs": [["lu", "qr", 1e-9, "acceleration", "b1"]],
}
GRAPH = {
    **{"key": "k1", "engine": "mbref", "version": "1", "seed": 1, "scene": "graph", "bodies": 5},
    **{"clearance": 0.1, "redundant": 3, "refused": "", "groups": [GROUP]},
}
INVARIANT = {
    "key": "mujoco, tuned whirl 1",
    **{"row": "mujoco, tuned", "engine": "mujoco", "version": "1", "family": "tuned", "message": ""},
    **{"experiment": "whirl", "outcome": "COMPLETED", "x": 1e-3, "values": {"energy": 1e-6}},
}


def table(command: str, place: Path, record: Any, end: bytes = b"\n") -> int:
    """Return the status of a command that prints the table of a file with one record."""
    path = place / "records.jsonl"
    path.write_bytes(json.dumps(record).encode() + end)
    return crosscheck([command, "--records", str(path)])


RUNS = {  # faulty fields of a run's record, and the words that name them
    "cost is missing": ({"cost": None}, "cost: field required"),
    "cost has no steps": ({"cost": {"seconds": 1.0}}, "cost.steps: field required"),
    "outcome is a list": ({"outcome": ["COMPLETED"]}, "outcome: input should be"),
    "refusal has no owner": ({"outcome": "REFUSED"}, "owner: field required"),
    "step is a word": (
        {"asked": {"engine": "mbref", "options": {"step": "short"}}},
        "asked.options: step: must be a positive number",
    ),
}
EXPERIMENTS = {
    "row is an engine's name": ({"row": "mujoco"}, "row must begin with 'mujoco, ', the engine and a comma"),
    "row has another engine": ({"row": "mbref, tuned"}, "row must begin with 'mujoco, '"),
    "values are missing": ({"values": None}, "x and values are required of a run"),
    "x is text": ({"x": "1"}, "x: input should be a valid number"),
}
WAYS = {
    "pair has no size": ({"groups": [GROUP | {"pairs": [["lu", "qr"]]}]}, "pairs.0: must be two ways"),
    "limit is zero": ({"groups": [GROUP | {"within": 0.0}]}, "within: input should be greater"),
}
TABLES = [  # the command of a table, its right record, and a faulty one
    (command, record, *fault)
    for command, record, faults in (
        *(("closed-loops", RECORD, RUNS), ("convergence", RECORD, RUNS)),
        *(("invariants", INVARIANT, EXPERIMENTS), ("alternatives", GRAPH, WAYS)),
    )
    for fault in faults.values()
]


@pytest.mark.parametrize(("command", "record", "changes", "said"), TABLES)
def test_table_of_records_names_the_faulty_field(command, record, changes, said, tmp_path, capsys):
    """A field has another value, or is missing (None). The table of the right record is printed."""
    faulty = {name: value for name, value in {**record, **changes}.items() if value is not None}
    assert table(command, tmp_path, faulty) == 2
    shown = capsys.readouterr().err
    assert said in shown and shown.count("\n") == 1
    assert table(command, tmp_path, record) == 0


of_each_table = pytest.mark.parametrize(
    ("command", "record"), [("convergence", RECORD), ("invariants", INVARIANT)]
)


@of_each_table
def test_table_of_records_names_a_record_that_it_cannot_show(command, record, tmp_path, capsys):
    """A right record of a mechanism or experiment that the table lacks: a line names it below the table."""
    lost = {**record, "key": "k2", "engine": "none", "row": "none, tuned", "experiment": "none"}
    assert table(command, tmp_path, lost) == 0
    assert capsys.readouterr().err == "no row and column of the table has record 'k2'\n"


@of_each_table
def test_table_of_records_reports_an_incomplete_last_line(command, record, tmp_path, capsys):
    """A line "{" behind a right record, as of a study that is being written."""
    assert table(command, tmp_path, record, b"\n{") == 0
    assert "the last line is incomplete and was left out" in capsys.readouterr().err


@of_each_table
def test_record_without_a_line_end_is_in_the_table(command, record, tmp_path, capsys):
    """The table is the one of the record with a line end."""
    shown = [table(command, tmp_path, record, end) or capsys.readouterr().out for end in (b"", b"\n")]
    assert shown[0] == shown[1] != ""


@pytest.mark.parametrize("command", ["alternatives", "closed-loops", "convergence", "invariants"])
def test_table_of_a_missing_file_of_records_is_an_error(command, tmp_path, capsys):
    assert crosscheck([command, "--records", str(tmp_path / "lost.jsonl")]) == 2
    assert "lost.jsonl: has no records" in capsys.readouterr().err


def test_records_of_another_mechanism_than_the_scene_file_are_named_and_not_left_out(tmp_path, capsys):
    """A record has the digest of its mechanism, which here is not that of the scene file beside it."""
    place = folder(tmp_path / "report", record_with("mechanism", "0123456789abcdef"))
    assert report(["--render", str(place)]) == 2
    assert "records of four_bar are of another mechanism" in capsys.readouterr().err


def test_report_shows_the_runs_at_the_times_of_the_latest_truth_alone(tmp_path):
    """A folder has runs of one mechanism to 0.1 s at 2 and at 3 samples, and to 0.2 s, with other errors. Its
    scene ends at 0.1 s, and the latest truth is of 3 samples. Bodies of a record may be in any order."""
    rows = {"position": 3, "orientation": 4, "velocity": 3, "angular_velocity": 3}
    states = {name: [[1.0] + [0.0] * (width - 1)] * 2 for name, width in rows.items()}
    bodies = dict.fromkeys(("rocker", "crank", "coupler"), states)
    asked = {"2.22e-05": {"samples": 2}, "3.33e-05": {"samples": 3}, "4.44e-05": {"samples": 3, "end": 0.2}}
    runs = [
        RECORD
        | {"key": error, "asked": RECORD["asked"] | when, "metrics": {"error": float(error)}}
        | {"bodies": bodies}
        for error, when in asked.items()
    ]
    place = folder(tmp_path / "r", "".join(json.dumps(run) + "\n" for run in runs).encode())
    truths = [truth_record(SCENES["four_bar"](), np.linspace(0.0, 0.1, k), 0.0) for k in (2, 3)]
    (place / "truths.jsonl").write_text("".join(strict_json(truth) + "\n" for truth in truths))
    assert report(["--render", str(place), "--section", "records"]) == 0
    shown = (place / "index.html").read_text()
    assert [error for error in asked if error in shown] == ["3.33e-05"]
    assert groups(place)[0].runs[0].trajectory.bodies == ("crank", "coupler", "rocker")
