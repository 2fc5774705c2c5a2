"""The command `crosscheck derivatives` on engines with right and with faulty derivatives."""

import json

import pytest

from crosscheck.cli import main
from crosscheck.engine import installed
from mbref.scene import Scene

ZOO = "tests.zoo.gradients"
FOUND = {  # engine of the zoo: words of the sentence on the cause
    "NONE": "",
    "VELOCITY_SIGN": "only in motion",
    "CONSTANT_JACOBIAN": "also at rest",
    "UNSTABILISED": "off the constraints",
    "QUATERNION": "also at rest",
}


@pytest.fixture
def loop(tmp_path) -> str:
    """Return the path of a moving body that turns and slides on a pin while a link of constant length holds
    it: a loop of one freedom, with independent rows."""
    place = {"position": [0.4, 0.2, 0.1], "angular_velocity": [0.0, 0.0, 3.0]}
    pin = {"name": "pin", "type": "cylindrical", "bodies": ["ground", "b"], "anchor": [0.0, 0.0, 0.0]}
    link = {"name": "link", "type": "distance", "bodies": ["ground", "b"]}
    joints = [{**pin, "axis": [0.0, 0.0, 1.0]}, {**link, "anchors": [[0.7, -0.3, 0.6], [0.5, 0.4, 0.2]]}]
    bodies = [{"name": "b", "mass": 1.3, "inertia": [0.02, 0.03, 0.04], **place}]
    scene = Scene(name="pin", gravity=(0.0, -3.0, -9.0), duration=1.0, body=bodies, joint=joints)
    scene.save(tmp_path / "loop.toml")
    return str(tmp_path / "loop.toml")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "words"), FOUND.items(), ids=FOUND)
def test_each_faulty_gradient_of_the_zoo_is_found_with_its_cause(loop, name, words, capsys):
    status = main(["derivatives", f"{ZOO}:{name}", loop])
    printed = capsys.readouterr().out
    assert status == (1 if words else 0)
    assert words in printed
    assert ("wrong by" in printed) == bool(words)


def test_mbref_is_right_and_engines_without_derivatives_are_refused_with_the_owner(loop, capsys):
    assert main(["derivatives", "mbref", "exudyn", loop, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {row["grade"] for row in found["rows"]} == {"right"}
    assert max(row["error"] for row in found["rows"]) <= 1e-11
    assert {row["by"] for row in found["rows"]} == {"position", "velocity", "force"}
    (refused,) = found["refused"]
    assert "exudyn" in refused["engine"] and "missing in the adapter" in refused["reason"]


@pytest.mark.slow
@pytest.mark.skipif(not installed("pinocchio"), reason="needs Pinocchio")
def test_known_defects_of_pinocchios_derivatives_are_found(capsys):
    """Findings pinocchio-derivatives-of-point-closure and -of-open-closure."""
    main(["derivatives", "pinocchio", "--json"])
    found = json.loads(capsys.readouterr().out)
    wrong = [row for row in found["rows"] if row["grade"] == "wrong"]
    pinned = {"ball_four_bar", "random_2"}
    own = [row for row in wrong if row["truth"] == "own differences"]
    at_points = [row for row in own if row["scene"] in pinned]
    assert {row["scene"] for row in at_points} == pinned
    assert {row["by"] for row in at_points} == {"position"}
    others = [row for row in wrong if row["scene"] not in pinned]
    assert {(row["function"], row["state"]) for row in others} == {
        ("LOCAL_WORLD_ALIGNED, Baumgarte", "open loops")
    }


@pytest.mark.skipif(not installed("mujoco"), reason="needs MuJoCo")
def test_mujoco_differentiates_its_own_step_and_is_rough_about_the_exact_motion(loop, capsys):
    """Closures of MuJoCo are soft: its derivatives are those of its step, and not of rigid loops."""
    main(["derivatives", "mujoco", loop, "--json"])
    found = json.loads(capsys.readouterr().out)
    rows = {(row["truth"], row["function"]): [] for row in found["rows"]}
    for row in found["rows"]:
        rows[row["truth"], row["function"]].append(row["error"])
    assert max(rows["own differences", "hard"]) <= 1e-6
    assert 1e-7 <= max(rows["judge", "hard"]) <= 1e-2 < max(rows["judge", "defaults"])
