"""Scene files: every fault named, round trips, defaults."""

import copy
import os
import subprocess
import sys

import pytest

from mbref.scene import Scene, SceneError
from mbref.scenes import SCENES

VALID = {
    "name": "door",
    "body": [
        {"name": "leaf", "mass": 2.0, "inertia": [1.0, 1.0, 1.0], "position": [0.5, 0.0, 0.0]},
        {"name": "bolt", "mass": 1.0, "inertia": [1.0, 1.0, 1.0], "position": [1.0, 0.0, 0.0]},
    ],
    "joint": [
        {"name": "H", "type": "revolute", "bodies": ["ground", "leaf"]}
        | {"anchor": [0, 0, 0], "axis": [0, 0, 1]},
        {"name": "S", "type": "spherical", "bodies": ["leaf", "bolt"], "anchor": [1, 0, 0]},
    ],
    "driver": [{"joint": "H", "polynomial": [0.0, 1.0]}],
    "load": [{"type": "force", "body": "leaf", "point": [1, 0, 0], "force": [0, 1, 0]}],
}

# path and new value (None: removed) of one change, and the path under which it must be reported
FAULTS = [
    (("body", 0, "mass"), -1.0, "body[leaf].mass"),
    (("body", 0, "mass"), "heavy", "body[leaf].mass"),
    (("body", 0, "inertia"), [1.0, 1.0, 3.0], "body[leaf].inertia"),
    (("body", 0, "inertia"), [1.0, 1.0], "body[leaf].inertia"),
    (("body", 0, "inertia"), [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]], "body[leaf].inertia"),
    (("body", 0, "inertia"), None, "body[leaf].inertia"),
    (("body", 1, "name"), "leaf", "body[1].name"),
    (("body", 1, "name"), "ground", "body[ground].name"),
    (("body", 0, "orientation"), [1.0, 0.1, 0.0, 0.0], "body[leaf].orientation"),
    (("body", 0, "position"), [0.0, float("nan"), 0.0], "body[leaf].position[1]"),
    (("body", 0, "position"), [0.0, 0.0], "body[leaf].position"),
    (("body", 0, "colour"), "red", "body[leaf].colour"),
    (("joint", 0, "axis"), [0, 0, 0], "joint[H].axis"),
    (("joint", 0, "type"), "hinge", "joint[H].type"),
    (("joint", 0, "bodies"), ["ground", "lid"], "joint[H].bodies[1]"),
    (("joint", 0, "bodies"), ["leaf", "leaf"], "joint[H].bodies"),
    (("joint", 1, "name"), "H", "joint[1].name"),
    (("driver", 0, "joint"), "S", "driver[S].joint"),
    (("driver", 0, "joint"), "X", "driver[X].joint"),
    (("driver", 0, "polynomial"), [0.5, 1.0], "driver[H].polynomial"),
    (("driver", 0, "polynomial"), [1e-11, 1.0], "driver[H].polynomial"),
    (("load", 0, "body"), "ground", "load[0].body"),
    (("load", 0, "type"), "wind", "load[0].type"),
    (("gravity",), [0, 0, float("inf")], "gravity[2]"),
    (("duration",), 0.0, "duration"),
    (("joint", 0, "axis"), [0, 0, 1e200], "joint[H].axis[2]"),
    (("joint", 0, "axis"), [0, 1e-200, 1e-200], "joint[H].axis"),
    (("body", 0, "mass"), 1e-200, "body[leaf].mass"),
    (("body", 0, "mass"), 10**400, "body[leaf].mass"),
    (("body", 0, "inertia"), [1e-200, 1.0, 1.0], "body[leaf].inertia"),
    (("body", 0, "inertia"), [1e200, 1e200, 1e200], "body[leaf].inertia"),
    (("body", 0, "inertia"), [10**400, 1.0, 1.0], "body[leaf].inertia"),
    (("body", 1, "name"), "the fixed frame", "body[the fixed frame].name"),
    (("driver", 0, "joint"), ["H"], "driver[0].joint"),
    (("load", 0, "type"), ["force"], "load[0].type"),
    (("joint", 1, "type"), ["spherical"], "joint[S].type"),
    (("driver", 0, "polynomial"), [10**400, 1.0], "driver[H].polynomial[0]"),
]


def changed(*changes):
    data = copy.deepcopy(VALID)
    for path, value in changes:
        target = data
        for key in path[:-1]:
            target = target[key]
        if value is None:
            del target[path[-1]]
        else:
            target[path[-1]] = value
    return data


def faults_of(data):
    with pytest.raises(SceneError) as caught:
        Scene(**data)
    return caught.value.faults


@pytest.mark.parametrize(("path", "value", "reported"), FAULTS)
def test_fault_is_reported_once_under_its_path(path, value, reported):
    """FAULTS has a path in a right scene, its wrong value, and the path that is reported. A renamed joint or
    body also breaks the entries that refer to it; they have faults of their own."""
    faults = faults_of(changed((path, value)))
    assert sum(fault.startswith(f"{reported}: ") for fault in faults) == 1, faults


@pytest.mark.parametrize("name", SCENES)
def test_saved_scene_is_read_back_equal(name, tmp_path):
    """Each built-in scene, written as TOML and read again."""
    scene = SCENES[name]()
    scene.save(tmp_path / "scene.toml")
    assert Scene.from_file(tmp_path / "scene.toml") == scene


def test_spring_between_coincident_points_must_have_the_natural_length_zero():
    """Such a spring has no direction, so that only a force of zero is defined."""
    spring = {"type": "spring", "bodies": ["leaf", "bolt"], "points": [[1, 0, 2], [1, 0, 2]], "stiffness": 5}
    data = copy.deepcopy(VALID)
    place = len(data["load"])
    loads = [*data["load"], spring | {"natural_length": 0}]
    assert Scene(**data | {"load": loads}).load[place].stiffness == 5
    faults = faults_of(data | {"load": [*data["load"], spring | {"natural_length": 0.1}]})
    assert len(faults) == 1 and faults[0].startswith(f"load[{place}].natural_length: must be 0"), faults


BROKEN = {
    "not TOML": (b"name = ", "is not TOML"),
    "too deep": (b"a = " + b"[" * 4000 + b"]" * 4000, "is nested too deeply"),
    "decimal number of 5000 digits": (b"a = " + b"1" * 5000, "is not TOML"),
    "hexadecimal number of 5000 digits": (b"duration = 0x" + b"f" * 5000, "duration: "),
    "not UTF-8": (b'name = "\xff"', "is not UTF-8 text"),
    "a zero byte": (b"\x00", "is not TOML"),
}


@pytest.mark.parametrize(("text", "says"), BROKEN.values(), ids=BROKEN)
def test_scene_file_that_is_too_deep_no_toml_no_text_or_of_a_huge_number_is_refused(text, says, tmp_path):
    """BROKEN has the bytes of a file and the words of its refusal. TOML's reader accepts hexadecimal numbers
    of any length and refuses decimal ones of over 4300 digits."""
    (tmp_path / "strange.toml").write_bytes(text)
    with pytest.raises(SceneError, match=says):
        Scene.from_file(tmp_path / "strange.toml")


def test_saved_scene_has_one_table_an_entry_and_one_field_a_line(tmp_path):
    """Three bodies, four joints and a load, in the syntax of TOML's arrays of tables."""
    scene = SCENES["four_bar"]().with_(load=({"type": "moment", "body": "crank", "moment": (0, 0, 1)},))
    scene.save(tmp_path / "my.toml")
    lines = (tmp_path / "my.toml").read_text().splitlines()
    assert lines.count("[[body]]") == 3 and lines.count("[[joint]]") == 4 and lines.count("[[load]]") == 1
    assert 'name = "A"' in lines and "axis = [0.0, 0.0, 1.0]" in lines and "moment = [0.0, 0.0, 1.0]" in lines


def test_faults_of_long_or_deep_values_are_shorter_than_200_characters():
    """A list in 900 lists, and a text of 9000 letters in a list."""
    deep = [0.0]
    for _ in range(900):
        deep = [deep]
    faults = faults_of(changed((("body", 0, "position"), deep), (("name",), ["x" * 9000])))
    assert faults and max(map(len, faults)) < 200, faults


def test_scene_file_is_utf8_in_every_locale_and_may_begin_with_a_byte_order_mark(tmp_path):
    """A process whose locale has ASCII as encoding reads a scene with a name of more letters and writes it.
    EF BB BF is the mark in UTF-8."""
    scene = Scene(**changed((("name",), "Türe α")))
    scene.save(tmp_path / "given.toml")
    (tmp_path / "given.toml").write_bytes(b"\xef\xbb\xbf" + (tmp_path / "given.toml").read_bytes())
    code = "import locale; from mbref.scene import Scene; Scene.from_file('given.toml').save('written.toml')"
    ascii_locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    command = [sys.executable, "-c", f"{code}; print(locale.getencoding())"]
    encoding = subprocess.check_output(command, cwd=tmp_path, env=os.environ | ascii_locale, text=True)
    assert encoding.strip() == "ANSI_X3.4-1968"  # the C library's name of ASCII
    assert "Türe α".encode() in (tmp_path / "written.toml").read_bytes()
    assert Scene.from_file(tmp_path / "written.toml") == scene


def test_joint_named_ground_is_a_fault_if_the_ground_is_a_body():
    """The ground as a body is held by a joint of this name; as a frame it has none."""
    data = changed((("joint", 1, "name"), "ground"))
    assert Scene(**data).ground == "frame"
    said = "joint[ground].name: 'ground' is reserved for the fixed frame"
    assert faults_of({**data, "ground": "body"}) == [said]
