"""Commands on the point pendulum, whose numbers are known, run interpreted by ``test_thresholds.py``."""

from __future__ import annotations

import csv
import json
import math

import pytest

from mbref.cli import main
from mbref.kernels.compilation import PLAIN
from mbref.scenes import find_scene

pytestmark = pytest.mark.skipif(not PLAIN, reason="kernels are interpreted by test_thresholds.py")
G, SHORT = 9.81, ("--duration", "0.02", "--samples", "3")


def printed(capsys: pytest.CaptureFixture[str], *arguments: str, status: int = 0) -> str:
    assert main(list(arguments)) == status, capsys.readouterr().err
    return capsys.readouterr().out


def test_a_run_as_json(capsys):
    """It falls from the horizontal: v² = 2 g h, and the bar pulls with 3 m g times the sine of the angle."""
    whole = json.loads(printed(capsys, "run", "point_pendulum", *SHORT, "--json"))
    [record] = whole["records"]
    assert (whole["scene"], record["outcome"], record["message"]) == ("point_pendulum", "COMPLETED", "")
    assert record["times"] == [0.0, 0.01, 0.02] and record["t_end"] == 0.02
    mass = record["bodies"]["mass"]
    assert mass["acceleration"][0] == pytest.approx([0.0, -G, 0.0], abs=1e-14)
    assert mass["angular_acceleration"][0] == pytest.approx([0.0, 0.0, G], abs=1e-14)
    for k in range(3):
        x, y, _ = mass["position"][k]
        speed = mass["angular_velocity"][k][2]
        assert math.hypot(x, y) == pytest.approx(1.0, rel=1e-15) and speed**2 == pytest.approx(
            -2 * G * y, abs=1e-15
        )
        pull = math.hypot(*record["reactions"]["pivot"][k][:2])
        assert pull == pytest.approx(-3 * G * y, abs=1e-12)
    assert mass["position"][2][1] == pytest.approx(-math.sin(G * 0.02**2 / 2), rel=1e-4)
    assert (
        record["error_estimate"]["largest"] < 1e-14 and record["error_estimate"]["exceeds_rtol_from"] is None
    )
    assert record["settings"]["rtol"] == 1e-9 and record["crossings"] == []


@pytest.mark.parametrize(
    ("arguments", "changed"),
    [
        (("--rtol", "1e-6"), {"rtol": 1e-6}),
        (("--max-step", "0.01"), {"largest_step": 0.01}),
        (("--code", "generic"), {"code": "generic"}),
        (("--code", "auto", "--method", "taylor[order=16]"), {}),
    ],
)
def test_options_of_a_run_are_its_settings(capsys, arguments, changed):
    whole = json.loads(
        printed(capsys, "run", "point_pendulum", *SHORT, "--json", "--estimate", "no", *arguments)
    )
    [record] = whole["records"]
    plain = {"rtol": 1e-9, "largest_step": 0.0, "code": "auto", "branches": []}
    assert {name: record["settings"][name] for name in plain} == {**plain, **changed}
    assert "error_estimate" not in record or record["error_estimate"] is None
    assert record["cost"]["steps"] == (2 if "--max-step" in arguments else 1)


def test_lines_of_a_run(capsys):
    lines = printed(
        capsys, "run", "point_pendulum", *SHORT, "--method", "lm1+none/rk4[step=0.01]"
    ).splitlines()
    assert lines[0] == "point_pendulum by lm1+none/rk4[step=0.01]: COMPLETED at t = 0.02 s"


def test_lines_of_a_run_by_series(capsys):
    text = printed(capsys, "run", "point_pendulum", *SHORT)
    lines = text.splitlines()
    assert lines[0] == "point_pendulum by taylor: COMPLETED at t = 0.02 s"
    assert lines[1].startswith("largest estimated error: ") and lines[2].startswith("1 steps, 0 rejected, ")
    assert "largest reaction 0.057742 N in joint pivot at t = 0.02 s" in lines
    assert "state at t = 0.02 s" in text and "-0.1962" in text


def test_times_and_columns_of_a_table(capsys, tmp_path):
    path = tmp_path / "run.csv"
    columns = ("--columns", "mass.position", "energy")
    printed(capsys, "run", "point_pendulum", "--times", "0,0.005,0.01", "--out", str(path), *columns)
    with path.open() as file:
        head, *rows = csv.reader(file)
    assert head[0] == "time" and [float(row[0]) for row in rows] == [0.0, 0.005, 0.01]
    y = head.index("mass.position.y")
    assert [float(row[y]) for row in rows] == pytest.approx(
        [-math.sin(G * t * t / 2) for t in (0, 0.005, 0.01)], rel=1e-4
    )
    assert len(head) == 5 and all(abs(float(row[4])) < 1e-12 for row in rows)


def test_diagnosis(capsys):
    text = printed(capsys, "diagnose", "point_pendulum")
    for line in ("coordinates         6", "constraint rows     5   (pivot 5)", "degrees of freedom  1"):
        assert line in text, line
    assert "along the motion" in text and "along the motion" not in printed(
        capsys, "diagnose", "point_pendulum", "--start"
    )
    record = json.loads(printed(capsys, "diagnose", "point_pendulum", "--json"))
    assert record["redundant"] == 0 and record["unique_reactions"] == ["pivot"]


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("draw", "point_pendulum"), "drawn.svg"),
        (("plot", "point_pendulum", "mass.position.y", *SHORT), "plot.svg"),
        (("animate", "point_pendulum", *SHORT), "film.svg"),
    ],
)
def test_pictures(capsys, tmp_path, arguments, name):
    printed(capsys, *arguments, "--out", str(tmp_path / name))
    text = (tmp_path / name).read_text()
    assert text.lstrip().startswith("<") and "</svg>" in text
    assert ("<animate" in text) == (name == "film.svg")


def test_a_new_scene_is_assembled_and_listed(capsys, tmp_path):
    path, other = tmp_path / "new.toml", tmp_path / "assembled.toml"
    printed(capsys, "new", str(path), "--like", "point_pendulum")
    assert find_scene(str(path)).body[0].position == (-1.0, 0.0, 0.0)
    printed(capsys, "assemble", str(path), "--out", str(other))
    assert find_scene(str(other)).body[0].position == pytest.approx((-1.0, 0.0, 0.0))
    assert "point_pendulum" in printed(capsys, "list", "scenes")
    assert "alf-dual" in printed(capsys, "list", "methods") and "position" in printed(
        capsys, "list", "outputs"
    )
    assert json.loads(printed(capsys, "schema"))["title"]
    assert "mbref" in printed(capsys, "completion", "bash")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            ("run", "point_pendulum", "--times", "0,0"),
            "--times: must be finite, not negative and increasing, got 0,0",
        ),
        (
            ("run", "point_pendulum", "--times", "0,x"),
            "--times: must be numbers separated by commas, got '0,x'",
        ),
        (("run", "point_pendulum", "--samples", "1"), "--samples: must be at least 2, got 1"),
        (("run", "point_pendulum", "--rtol", "-1"), "--rtol: must be"),
        (("run", "none"), "unknown scene 'none'; built-in: four_bar, "),
        (
            ("animate", "point_pendulum", *SHORT, "--branches"),
            "--branches: no singular position up to t = 0.02 s",
        ),
    ],
)
def test_arguments_that_are_refused(capsys, arguments, says):
    assert main(list(arguments)) == 2
    assert capsys.readouterr().err.startswith(says)
