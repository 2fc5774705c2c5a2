"""Lines of scene files, paths of fields and words of command lines / texts worked out by hand."""

from __future__ import annotations

import argparse
import os
from types import SimpleNamespace
from typing import Any

import pytest

from mbref import command_line, method, scene_paths, scene_toml
from mbref.scene import Body, SceneError

TEXT = """\
name = "s"
gravity = [0, 0, -9.81]
# name = "no"

[[body]]
name = "a"
mass = 1.0
[[body]]
mass = 2.0
name = 'b'
[[ joint ]]
name = "A"
"axis" = [
  0, 0, 1]
[[driver]]
name = "no"
joint = "A"
[driver.sine]
phase = 1
[[body]]
name = "a"
"""
LINES = [
    (1, "", 0, "name"),
    (2, "", 0, "gravity"),
    (5, "body", 0, ""),
    (6, "body", 0, "name"),
    (7, "body", 0, "mass"),
    (8, "body", 1, ""),
    (9, "body", 1, "mass"),
    (10, "body", 1, "name"),
    (11, "joint", 0, ""),
    (12, "joint", 0, "name"),
    (13, "joint", 0, "axis"),
    (15, "driver", 0, ""),
    (16, "driver", 0, "name"),
    (17, "driver", 0, "joint"),
    (18, "driver.sine", 0, ""),
    (19, "driver.sine", 0, "phase"),
    (20, "body", 2, ""),
    (21, "body", 2, "name"),
]


def test_lines_and_names_of_a_file():
    assert list(scene_toml._lines(TEXT)) == LINES
    names = {("", "s"): 0, ("body", "a"): 0, ("body", "b"): 1, ("joint", "A"): 0, ("driver", "A"): 0}
    assert scene_toml._names(TEXT, LINES) == names


@pytest.mark.parametrize(
    ("fault", "line"),
    [
        ("body[a].mass: x", 7),
        ("body[b].mass: x", 9),
        ("body[1].name: x", 10),
        ("body[2].name: x", 21),
        ("body[a].inertia: x", 5),
        ("body[b]: x", 8),
        ("body[z].mass: x", None),
        ("body[7].mass: x", None),
        ("joint[A].axis[1]: x", 13),
        ("driver[A].joint: x", 17),
        ("driver[no].joint: x", None),
        ("gravity[0]: x", 2),
        ("gravity: x", 2),
        ("duration: x", None),
        ("joint: x", 11),
        ("load[0].force: x", None),
        ("load: x", None),
        ("(no path)", None),
    ],
)
def test_lines_of_faults(fault, line):
    names = scene_toml._names(TEXT, LINES)
    assert scene_toml._line_of(LINES, names, fault) == line
    assert scene_toml.with_lines(TEXT, [fault]) == [fault + (f" (line {line})" if line else "")]


def test_faults_that_have_a_line_keep_it():
    assert scene_toml.with_lines(TEXT, ["body[a].mass: x (line 3)"]) == ["body[a].mass: x (line 3)"]


@pytest.mark.parametrize(
    ("text", "error", "hint"),
    [
        ("a = 1\n [joint]\nb=2", "at line 3", "; line 2: [joint] must be [[joint]], one for each joint"),
        ("[ load ]", "", "; line 1: [load] must be [[load]], one for each load"),
        ("a = 1\n  b = = 2  \n", "Invalid value (at line 2, column 5)", ": b = = 2"),
        ("a = " + "1" * 90, "at line 1", ": a = " + "1" * 76),
        ("a = 1", "at line 2", ""),
        ("a = 1", "somewhere", ""),
        ("[[joint]]", "somewhere", ""),
        ("[sine]", "at line 1", ": [sine]"),
    ],
)
def test_hints_of_toml(text, error, hint):
    assert scene_toml.toml_hint(text, error) == hint


def test_texts_of_scenes():
    data = {
        "load": [{"force": [1.0, 2.5], "type": "force", "body": "b"}],
        "body": [{"position": [0.0], "mass": 2, "name": "b"}, {"name": "c"}],
        "gravity": [0.0, -9.5],
        "name": "s",
    }
    assert scene_toml.scene_text(data) == (
        'name = "s"\ngravity = [0.0, -9.5]\n\n'
        '[[load]]\ntype = "force"\nbody = "b"\nforce = [1.0, 2.5]\n\n'
        '[[body]]\nname = "b"\nposition = [0.0]\nmass = 2\n\n[[body]]\nname = "c"\n'
    )
    keys = [line.split(" ")[0] for line in scene_toml._key_lines(dict.fromkeys("zyx", 1))]
    assert keys == ["z", "y", "x"]
    order = ("body", "bodies", "joints", "joint", "type", "name")
    assert [line.split(" ")[0] for line in scene_toml._key_lines(dict.fromkeys(order, 1))] == list(
        order[::-1]
    )
    assert scene_toml._value({"b": [1, [2.0]], "name": "x"}) == '{ name = "x", b = [1, [2.0]] }'
    assert scene_toml._value(True) == "true"
    assert scene_toml._is_of_tables([{}]) and not scene_toml._is_of_tables([1])
    assert not scene_toml._is_of_tables({}) and not scene_toml._is_of_tables([])
    assert scene_toml._is_of_tables([1, {}])
    assert scene_toml.as_lists({"a": ((1, 2), "x")}) == {"a": [[1, 2], "x"]}


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "cannot be read: No such file or directory"),
        (b"a = = 1", "is not TOML: Invalid value"),
        (b"a = '\xff'", "is not UTF-8 text (at byte 5)"),
        (b"a = " + b"[" * 5000, "is nested too deeply"),
        (b"a = " + b"1" * 5000, "is not TOML: Exceeds the limit"),
    ],
)
def test_files_that_are_no_toml(tmp_path, content, says):
    path = tmp_path / "s.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError) as error:
        scene_toml.read_toml(path)
    assert error.value.faults[0].startswith(f"{path}: {says}") and len(error.value.faults) == 1


def test_a_file_with_a_byte_order_mark(tmp_path):
    (tmp_path / "s.toml").write_bytes(b"\xef\xbb\xbfa = 1\n")
    assert scene_toml.read_toml(tmp_path / "s.toml") == ("a = 1\n", {"a": 1})


# --- paths --------------------------------------------------------------------------------------------------
FIELDS = {
    "gravity": (1.0, 2.0, 3.0),
    "body": (Body(name="a", position=(1.0, 2.0, 3.0)), {"name": "b", "mass": 2.0}, {"joint": "A", "x": 5}),
}


@pytest.mark.parametrize(
    ("path", "steps"),
    [
        ("gravity[1]", ["gravity", "1"]),
        ("body[a].position[0]", ["body", "a", "position", "0"]),
        ("body[a b].mass", ["body", "a b", "mass"]),
    ],
)
def test_steps_of_paths(path, steps):
    assert scene_paths._steps(FIELDS, path) == steps


@pytest.mark.parametrize("path", ["", "mass", "gravity[", "gravity..x!", "[0]", "body[]"])
def test_paths_that_are_none(path):
    with pytest.raises(SceneError, match="is not a path of a scene, such as"):
        scene_paths._steps(FIELDS, path)


def test_values_at_paths():
    found = scene_paths.replaced_at(FIELDS, "gravity[1]", lambda x: x * 10)
    assert found == {**FIELDS, "gravity": (1.0, 20.0, 3.0)}
    found = scene_paths.replaced_at(FIELDS, "body[b].mass", lambda x: x + 1)
    assert found["body"][1] == {"name": "b", "mass": 3.0} and found["body"][0] is FIELDS["body"][0]
    found = scene_paths.replaced_at(FIELDS, "body[0].position[2]", lambda x: -x)
    assert found["body"][0]["position"] == (1.0, 2.0, -3.0) and found["body"][0]["name"] == "a"
    found = scene_paths.replaced_at(FIELDS, "body[A].x", lambda x: x + 1)
    assert found["body"][2] == {"joint": "A", "x": 6}


@pytest.mark.parametrize(
    ("path", "says"),
    [
        ("body[3].mass", "body[3].mass: the scene has no '3' there"),
        ("body[bb].mass", "body[bb].mass: the scene has no 'bb' there; did you mean 'b'?"),
        ("body[b].mas", "body[b].mas: the scene has no 'mas' there; did you mean 'mass'?"),
        ("body[a].masss", "body[a].masss: the scene has no 'masss' there; did you mean 'mass'?"),
        ("gravity[0].x", "gravity[0].x: the scene has no 'x' there"),
        ("gravity[x]", "gravity[x]: the scene has no 'x' there"),
    ],
)
def test_paths_that_end_nowhere(path, says):
    with pytest.raises(SceneError) as error:
        scene_paths.replaced_at(FIELDS, path, lambda x: x)
    assert error.value.faults == [says]


# --- command lines ------------------------------------------------------------------------------------------
def repeating() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser()
    made.add_argument("--length", "-l", action="append")
    made.add_argument("--out")
    return made


@pytest.mark.parametrize(
    ("words", "extra", "says"),
    [
        ("assemble --length a b", "b", "; repeat the option for each value: --length a --length b"),
        ("assemble -l a b", "b", "; repeat the option for each value: -l a -l b"),
        ("assemble --out a b", "b", ""),
        ("--length b", "b", ""),
        ("assemble b", "b", ""),
        ("b", "b", ""),
    ],
)
def test_options_that_may_repeat(words, extra, says):
    assert command_line._repeated(repeating(), words.split(), extra) == says


def test_choices_and_numbers_that_are_refused(capsys):
    made = command_line.Parser(prog="p")
    made.add_argument("--count", type=int)
    made.add_argument("--rate", type=float)
    made.add_argument("--code", choices=("auto", "generic"))
    for words, says in (
        (["--count", "x"], "argument --count: must be a whole number, got 'x'"),
        (["--rate", "x"], "argument --rate: must be a number, got 'x'"),
        (["--code", "autoo"], "argument --code: unknown 'autoo'; known: auto, generic; did you mean 'auto'?"),
        (["--cod", "auto", "--zzz"], "unknown option '--zzz'"),
        (["--coun"], "argument --count: expected one argument"),
        (["word"], "unknown argument 'word'"),
    ):
        with pytest.raises(SystemExit) as end:
            made.parse_args(words)
        assert end.value.code == 2 and says in capsys.readouterr().err, words


def test_files_and_folders_that_can_be_written(tmp_path, monkeypatch):
    inner, file = tmp_path / "new" / "inner", tmp_path / "file"
    file.write_text("x")
    for good in (file, tmp_path / "other"):
        assert command_line.output_file(str(good)) == str(good)
    for good in (tmp_path, inner):
        assert command_line.output_folder(str(good)) == str(good)
    refused = argparse.ArgumentTypeError
    with pytest.raises(refused, match=f"{tmp_path} is a folder; name a file"):
        command_line.output_file(str(tmp_path))
    with pytest.raises(refused, match=f"there is no folder {inner}"):
        command_line.output_file(str(inner / "file"))
    with pytest.raises(refused, match=f"{file} is a file; name a folder"):
        command_line.output_folder(str(file / "inner"))
    asked: list[Any] = []
    monkeypatch.setattr(os, "access", lambda place, mode: asked.append((place, mode)))
    for call, path, place in (
        (command_line.output_file, file, file),
        (command_line.output_file, tmp_path / "other", tmp_path),
        (command_line.output_folder, inner, tmp_path),
    ):
        with pytest.raises(refused, match=f"^{path} cannot be written: no permission for {place}$"):
            call(str(path))
        assert asked.pop() == (place, os.W_OK)


# --- methods ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("a+b", ("a", "+", "b")),
        ("a[x=1e+5]+b", ("a[x=1e+5]", "+", "b")),
        ("a[x=1e+5]", ("a[x=1e+5]", "", "")),
        ("a[1]+b[2+3]", ("a[1]", "+", "b[2+3]")),
        ("a+b+c", ("a", "+", "b+c")),
        ("", ("", "", "")),
    ],
)
def test_parts_that_a_plus_joins(text, parts):
    assert method._split_outside_brackets(text) == parts


@pytest.mark.parametrize(
    ("bodies", "name"), [(1, "taylor"), (100, "taylor"), (101, "alf-dual+projection/dop853")]
)
def test_default_methods(bodies, name):
    scene: Any = SimpleNamespace(body=[None] * bodies)
    assert method.default_method(scene) == name
    assert method.short_name("alf-dual+projection/taylor") == "taylor" and method.short_name("x") == "x"
