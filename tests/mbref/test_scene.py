"""Scene files: every fault named, round trips, defaults."""

import copy

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
        {
            "name": "H",
            "type": "revolute",
            "bodies": ["ground", "leaf"],
            "anchor": [0, 0, 0],
            "axis": [0, 0, 1],
        },
        {"name": "S", "type": "spherical", "bodies": ["leaf", "bolt"], "anchor": [1, 0, 0]},
    ],
    "driver": [{"joint": "H", "polynomial": [0.0, 1.0]}],
    "load": [{"type": "force", "body": "leaf", "point": [1, 0, 0], "force": [0, 1, 0]}],
}

# one change each, and the path it must be reported under
FAULTS = [
    (("body", 0, "mass"), -1.0, "body[0].mass"),
    (("body", 0, "mass"), "heavy", "body[0].mass"),
    (("body", 0, "inertia"), [1.0, 1.0, 3.0], "body[0].inertia"),
    (("body", 0, "inertia"), [1.0, 1.0], "body[0].inertia"),
    (("body", 0, "inertia"), [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]], "body[0].inertia"),
    (("body", 0, "inertia"), None, "body[0].inertia"),
    (("body", 1, "name"), "leaf", "body[1].name"),
    (("body", 1, "name"), "ground", "body[1].name"),
    (("body", 0, "orientation"), [1.0, 0.1, 0.0, 0.0], "body[0].orientation"),
    (("body", 0, "position"), [0.0, float("nan"), 0.0], "body[0].position[1]"),
    (("body", 0, "position"), [0.0, 0.0], "body[0].position[2]"),
    (("body", 0, "colour"), "red", "body[0].colour"),
    (("joint", 0, "axis"), [0, 0, 0], "joint[0].axis"),
    (("joint", 0, "type"), "hinge", "joint[0].type"),
    (("joint", 0, "bodies"), ["ground", "lid"], "joint[0].bodies[1]"),
    (("joint", 0, "bodies"), ["leaf", "leaf"], "joint[0].bodies"),
    (("joint", 1, "name"), "H", "joint[1].name"),
    (("driver", 0, "joint"), "S", "driver[0].joint"),
    (("driver", 0, "joint"), "X", "driver[0].joint"),
    (("driver", 0, "polynomial"), [0.5, 1.0], "driver[0].polynomial"),
    (("load", 0, "body"), "ground", "load[0].body"),
    (("load", 0, "type"), "wind", "load[0].type"),
    (("gravity",), [0, 0, float("inf")], "gravity[2]"),
    (("duration",), 0.0, "duration"),
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


def test_valid_scene_is_accepted():
    assert Scene(**VALID).joint[0].type == "revolute"


@pytest.mark.parametrize(("path", "value", "reported"), FAULTS)
def test_fault_and_its_path(path, value, reported):
    faults = faults_of(changed((path, value)))
    # renaming a joint or body also breaks what refers to it; the fault itself must be there once
    assert sum(fault.startswith(f"{reported}: ") for fault in faults) == 1, faults


def test_ten_faults_ten_messages():
    ten = [FAULTS[k] for k in (0, 2, 8, 9, 11, 12, 17, 19, 20, 22)]
    faults = faults_of(changed(*((path, value) for path, value, _ in ten if path != ("driver", 0, "joint"))))
    assert len(faults) == 9, "\n".join(faults)
    faults = faults_of(changed(*((path, value) for path, value, _ in ten)))
    assert sorted(f.split(": ")[0] for f in faults) == sorted(r for _, _, r in ten), "\n".join(faults)


@pytest.mark.parametrize("name", SCENES)
def test_save_and_load_give_an_equal_scene(name, tmp_path):
    scene = SCENES[name]()
    scene.save(tmp_path / "scene.toml")
    assert Scene.from_file(tmp_path / "scene.toml") == scene


def test_every_kind_of_entry_round_trips(tmp_path):
    data = copy.deepcopy(VALID)
    axis = {"anchor": [0, 0, 0], "axis": [0, 1, 1]}
    pair = {"bodies": ["leaf", "bolt"]}
    data["joint"] += [
        {"name": "f", "type": "fixed", **pair, "anchor": [0, 0, 0]},
        {"name": "u", "type": "universal", **pair, "anchor": [0, 0, 0], "axes": [[1, 0, 0], [0, 1, 0]]},
        {"name": "t", "type": "translational", **pair, **axis},
        {"name": "c", "type": "cylindrical", **pair, **axis},
        {"name": "p", "type": "planar", **pair, **axis},
        {"name": "d", "type": "distance", **pair, "anchors": [[0, 0, 0], [1, 1, 1]]},
    ]
    data["driver"].append({"joint": "t", "sine": {"amplitude": 0.1, "frequency": 2.0}})
    data["load"] += [
        {"type": "moment", "body": "leaf", "moment": [0, 0, 1]},
        {"type": "spring", **pair, "points": [[0, 0, 0], [1, 0, 0]], "stiffness": 5, "natural_length": 0.5},
        {"type": "torsion_spring", "joint": "H", "stiffness": 2, "damping": 0.1, "natural_angle": 1},
    ]
    data["body"][0]["inertia"] = [[1.0, 0.1, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.2]]
    scene = Scene(**data, ground="body", gravity=(0, 0, -9.81), duration=3)
    scene.save(tmp_path / "scene.toml")
    assert Scene.from_file(tmp_path / "scene.toml") == scene


def test_unreadable_files_are_faults(tmp_path):
    with pytest.raises(SceneError, match="cannot be read"):
        Scene.from_file(tmp_path / "missing.toml")
    (tmp_path / "broken.toml").write_text("name = \n")
    with pytest.raises(SceneError, match="is not TOML"):
        Scene.from_file(tmp_path / "broken.toml")
