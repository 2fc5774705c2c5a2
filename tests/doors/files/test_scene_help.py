"""Help with scene files: lines and suggestions in faults, probable slips, units, the schema, the commands. A
probable slip is a valid number that is likely to be a mistake, as an angle in degrees."""

import json
from importlib.resources import files
from pathlib import Path

import pytest

from crosscheck.conformance.changes.units import in_other_units
from mbref.cli import main
from mbref.cli.output import Lines
from mbref.cli.scene_files import schema, template
from mbref.formulations import FORMULATIONS
from mbref.integrators import INTEGRATORS
from mbref.scene import Revolute, Scene, SceneError
from mbref.scene.slips import probable_slips
from mbref.scenes import SCENES, find_scene
from mbref.stabilisation import STABILISATIONS


def faults(tmp_path: Path, *changes: tuple[str, str]) -> list[str]:
    """Return the faults of the template after replacements of its text."""
    text = template()
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    (tmp_path / "my.toml").write_text(text)
    with pytest.raises(SceneError) as caught:
        Scene.from_file(tmp_path / "my.toml")
    return caught.value.faults


SKEW = 'type = "universal"\nbodies = ["crank", "rod"]\naxes = [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]'
FAULTY = {
    "sign": [("mass = 2.0", "mass = -2.0")],
    "unknown key": [("gravity =", "gravty =")],
    "unknown key of a joint": [("anchor = [0.2", "ancor = [0.2")],
    "unknown body": [('"rod", "slider"', '"rood", "slider"')],
    "unknown type": [('type = "translational"', 'type = "translatonal"')],
    "zero": [("duration = 2.0", "duration = 0.0")],
    "unknown body of a load": [('body = "crank"', 'body = "crnk"')],
    "ground": [('"ground", "crank"', '"world", "crank"')],
    "case": [('"ground", "crank"', '"ground", "Crank"')],
    "hinge": [('type = "revolute"', 'type = "hinge"')],
    "two numbers": [("position = [0.5, 0.0, 0.0]", "position = [0.5, 0.0]")],
    "one number": [("gravity = [0.0, -9.81, 0.0]", "gravity = -9.81")],
    "unknown key of a load": [("moment = [", "speed = [")],
    "unknown part": [("[[load]]", "[[loads]]")],
    "missing field": [("mass = 1.5\n", "")],
    "one name twice": [('name = "rod"', 'name = "crank"')],
    "table": [("[[load]]", "[load]")],
    "driver of an unknown type": [
        ('type = "revolute"', 'type = "hinge"'),
        ("[[load]]", '[[driver]]\njoint = "A"\n\n[[load]]'),
    ],
    "skew axes": [
        ('type = "revolute"\nbodies = ["crank", "rod"]', SKEW),
        ("anchor = [0.2, 0.0, 0.0]\naxis = [0.0, 0.0, 1.0]", "anchor = [0.2, 0.0, 0.0]"),
    ],
}


@pytest.mark.parametrize("name", FAULTY)
def test_each_fault_is_one_sentence_with_its_line_and_a_suggestion(name, tmp_path, snapshot):
    """FAULTY has one change of the template each; the sentences of the snapshot were checked by reading."""
    assert faults(tmp_path, *FAULTY[name]) == snapshot


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("[[joint]]", "[joint]", "[joint] must be [[joint]], one for each joint"),
        ("position = [0.5, 0.0, 0.0]", "position = 0.5, 0.0, 0.0", ": position = 0.5, 0.0, 0.0"),
    ],
)
def test_wrong_table_is_explained_and_a_line_that_is_no_toml_is_quoted(tmp_path, old, new, says):
    """One text of the template is replaced, by a single table or by numbers without brackets."""
    (fault,) = faults(tmp_path, (old, new))
    assert says in fault


def test_missing_file_suggests_a_file_of_the_folder_or_a_built_in_scene(tmp_path, monkeypatch):
    """The folder has pendulum.toml; Bennett's linkage is a built-in scene, whose name has no ending."""
    monkeypatch.chdir(tmp_path)
    Path("pendulum.toml").touch()
    for name, says in (("pendulm.toml", "did you mean 'pendulum.toml'?"), ("bennett.toml", "'bennett' is")):
        with pytest.raises(SceneError, match=f"no such file.*{says}".replace("?", r"\?")):
            find_scene(name)


def test_fault_found_by_a_run_states_the_line_of_its_entry(tmp_path, capsys):
    """The rod has no mass; its entry begins in the line before its name."""
    text = template().replace("mass = 2.0\ninertia = [1e-4, 0.06, 0.06]\n", "")
    (tmp_path / "my.toml").write_text(text)
    assert main(["run", str(tmp_path / "my.toml")]) == 2
    entry = text.splitlines().index('name = "rod"')
    said = capsys.readouterr().err.splitlines()[-1]
    assert "'rod' has no mass" in said and said.endswith(f"(line {entry})")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["rnu", "my.toml"], "did you mean 'run'?"),
        (["run", "four_bar", "--methd", "lm1"], "mbref run: error: unknown option '--methd'; did you mean"),
        (["run", "four_bar", "--duration", "1s"], "--duration: must be a number, got '1s'"),
        (["list", "scene"], "did you mean 'scenes'?"),
        ([], "mbref diagnose my.toml"),
    ],
)
def test_wrong_or_empty_command_line_ends_with_status_2_and_says_what_to_type(capsys, words, says):
    """A misspelt word has the nearest one, a number with a unit its fault, no words have examples."""
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2 and says in capsys.readouterr().err


def turning(rate: float | str) -> list[dict]:
    """Return a driver of joint A with a constant rate (rad/s, or with a unit)."""
    return [{"joint": "A", "polynomial": [0.0, rate]}]


@pytest.mark.parametrize(
    ("path", "value", "slip"),
    [
        ("gravity", [0.0, -9810.0, 0.0], "gravity: 9810 m/s² is 1e+03 times the earth's; is it in mm/s²?"),
        (
            "body[rod].inertia",
            [1e3, 1e4, 1e4],
            "body[rod].inertia: suits a body 161 m across, the mechanism measures 0.709 m; is it in kg m²?",
        ),
        (
            "joint[D].anchor",
            [700.0, 0.0, 0.0],
            "body[slider]: C–D is 699.291 m, B–C 0.4048 m; is one in millimetres?",
        ),
        ("joint", [], "joint: there is none, so nothing connects crank, rod, slider"),
        ("driver", turning(100.1), "driver[A].polynomial: turns the joint by 100.1 rad, 15.9 turns"),
        ("driver", turning(-100.1), "driver[A].polynomial: turns the joint by 100.1 rad, 15.9 turns"),
    ],
)
def test_probable_slip_is_one_sentence(path, value, slip):
    """Slips are mm in gravity, inertia and an anchor, no joints, and a turn of more than 100 rad in 1 s. The
    rod of 0.4048 kg would have the radius √(2.1e4 / 2 / 0.4048) = 161 m; C is at x = 0.709 m."""
    scene = find_scene("planar_slider_crank").with_(duration=1.0, load=())
    [found] = probable_slips(scene.with_(path, value))
    assert found.startswith(slip)


EXAMPLES = sorted((Path(__file__).parents[3] / "examples").rglob("*.toml"))
SCENE_FILES = [path for path in EXAMPLES if "[[body]]" in path.read_text()]


@pytest.mark.parametrize("scene", (*SCENES, *map(str, SCENE_FILES)), ids=lambda name: Path(name).name)
def test_no_built_in_scene_and_no_scene_of_the_examples_has_a_probable_slip(scene):
    """SCENE_FILES are the files of the folder examples with a body."""
    assert probable_slips(find_scene(scene)) == []


def with_hinges(*axes, height: float = 0.0) -> Scene:
    """Return the slider-crank in the plane z = 0, whose hinges A and B are normal to it, with hinges between
    rod and slider of the given axes, at a height above the plane (m)."""
    scene = find_scene("planar_slider_crank")
    x, y, _ = scene.joint_named("C").anchor
    given = {"bodies": ("rod", "slider"), "anchor": (x, y, height)}
    further = [Revolute(name=f"T{k}", axis=axis, **given) for k, axis in enumerate(axes)]
    return scene.with_(joint=(*scene.joint, *further))


@pytest.mark.parametrize(
    ("scene", "slips"),
    [
        (with_hinges((1.0, 2.0, 0.0)), 1),
        (with_hinges((0.0, 0.0, 1.0)), 0),
        (with_hinges((1.0, 0.0, 1.0)), 0),
        (with_hinges((1.0, 0.0, 0.0), height=0.1), 0),
        (with_hinges((1.0, 0.0, 0.0), (1.0, 2.0, 0.0)), 0),
        (with_hinges(*[(1.0, 0.0, 0.0)] * 3), 0),
    ],
    ids=[
        *("one in the plane", "none in the plane", "at 45 degrees"),
        *("no common plane", "two of four", "three of five"),
    ],
)
def test_only_a_single_hinge_axis_in_the_plane_of_a_planar_mechanism_is_a_probable_slip(scene, slips):
    """Hinges A and B are normal to the plane; the ids say whether further hinges T0, T1, … lie in it."""
    slip = "joint[T0].axis: lies in the plane of the mechanism; other axes are across it"
    assert probable_slips(scene) == [slip] * slips


@pytest.mark.parametrize(
    "motion", [{"sine": {"amplitude": "30 deg", "phase": 1.6}}, {"polynomial": ["30 deg"]}]
)
def test_driver_that_does_not_begin_at_zero_is_refused_with_its_value_in_radians(motion):
    """The value at t = 0 is 30° = 0.5236 rad, or 30° sin 1.6 = 0.5234 rad."""
    with pytest.raises(SceneError, match=r"must be 0, motion is measured from t = 0; got 0\.523"):
        find_scene("four_bar").with_(driver=({"joint": "A", **motion},))


def test_orientation_in_degrees_is_refused_with_the_formula_of_the_quaternion():
    """A user may take the orientation for an angle."""
    with pytest.raises(SceneError, match=r"φ about z cos\(φ/2\), 0, 0, sin\(φ/2\), got '60 deg'"):
        find_scene("four_bar").with_("body[crank].orientation", "60 deg")


@pytest.mark.parametrize("text", ["wide", "3 parsec", "30 deg", "1e999 mm", "1 2 mm"])
def test_text_that_is_no_length_is_refused_in_a_sentence(text, snapshot):
    """A word, an unknown unit, a unit of angle, a huge value, two numbers; the snapshot was read."""
    with pytest.raises(SceneError) as caught:
        find_scene("four_bar").with_("joint[A].anchor", [text, 0.0, 0.0])
    assert caught.value.faults == snapshot


def test_diagnose_prints_values_with_units_in_si(tmp_path, capsys):
    """The crank's position in the template, 0.1 m along x, is written in mm."""
    (old,) = [line for line in template().splitlines() if line.startswith("position = [0.1,")]
    (tmp_path / "my.toml").write_text(template().replace(old, old.replace("[0.1,", '["100 mm",')))
    assert main(["diagnose", str(tmp_path / "my.toml"), "--start"]) == 0
    assert "100 mm = 0.1 m" in capsys.readouterr().out


@pytest.mark.parametrize(("angle", "slips"), [("-800 deg", 0), (-69.0, 1)])
def test_natural_angle_beyond_a_turn_without_a_unit_is_a_probable_slip(angle, slips):
    """The spring of the example has -69 degrees; a file without the unit means rad."""
    scene = Scene.from_file(Path(__file__).parents[3] / "examples" / "door_closer.toml")
    slip = "load[0].natural_angle: -69 rad is more than a turn; is it in degrees?"
    assert probable_slips(scene.with_("load[0].natural_angle", angle)) == [slip] * slips


@pytest.mark.parametrize(
    ("rate", "slips"), [(720.0, 1), (-90.0, 1), (99.9, 0), (6.0, 0), (0.0, 0), ("6000 deg", 0)]
)
def test_rate_of_a_driver_of_whole_quarters_of_a_turn_is_a_probable_slip_of_degrees(rate, slips):
    """720 and -90 are whole multiples of 90 other than zero; 99.9, 6 and 0 rad/s are not. With the unit
    degrees there is no slip. In 0.1 s none turns by more than 100 rad."""
    driven = find_scene("four_bar").with_(driver=turning(rate), duration=0.1)
    assert len(probable_slips(driven)) == slips


def test_shipped_schema_is_generated_from_the_model_and_has_every_field():
    """`mbref schema` prints it: a property for each field of a scene, and what a hinge requires."""
    shipped = json.loads((files("mbref") / "templates" / "scene.schema.json").read_text())
    assert shipped == schema(), "mbref schema > mbref/templates/scene.schema.json renews it"
    assert set(shipped["properties"]) == set(Scene.model_fields)
    assert shipped["$defs"]["Revolute"]["required"] == ["name", "bodies", "anchor", "axis"]


@pytest.fixture
def my_toml(tmp_path, monkeypatch, capsys):
    """The template, written by the command new into an empty working folder."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "my.toml"]) == 0
    capsys.readouterr()
    return "my.toml"


def test_command_assemble_gives_a_link_its_length_and_diagnose_states_it(my_toml, capsys):
    """A link from A to B of 0.2 m becomes 0.25 m long along x: joint B moves by 0.05 m."""
    assert main(["assemble", "my.toml", "--length", "A-B=0.25", "--out", "closed.toml"]) == 0
    out = capsys.readouterr().out
    assert "length A–B: 0.2 m, now 0.25 m" in out and "joint B: moved by 0.05 m" in out, out
    assert Scene.from_file("closed.toml").joint_named("B").anchor == pytest.approx((0.25, 0, 0))
    assert main(["diagnose", "closed.toml", "--start", "--json"]) == 0
    found = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert found["links"]["crank"] == {"A–B": pytest.approx(0.25)}


def test_command_assemble_refuses_lengths_that_are_wrong_or_have_two_meanings(tmp_path, capsys):
    """The pair A-B is also the pair B-A. Joints are named A, B-C, C and A-B, so that A-B-C is a pair in two
    ways."""
    named = zip(pinned_four_bar().joint, ("A", "B-C", "C", "A-B"), strict=True)
    joints = [joint.model_copy(update={"name": name}) for joint, name in named]
    for path, scene in (("four", pinned_four_bar()), ("hyphens", pinned_four_bar().with_(joint=joints))):
        scene.save(tmp_path / path)
    ways = "may be the joints 'A' and 'B-C' or 'A-B' and 'C'"
    wrong = [("four", ["A-B=-1"], "got 'A-B=-1'"), ("four", ["A-B=0.25", "B-A=0.3"], "gives B-A twice")]
    for path, lengths, said in (*wrong, ("hyphens", ["A-B-C=0.5"], ways)):
        assert main(["assemble", str(tmp_path / path), *(f"--length={length}" for length in lengths)]) == 2
        assert said in capsys.readouterr().err


def test_command_assemble_names_moved_joints_of_a_linkage_of_half_a_micrometre(tmp_path, capsys):
    """The crank of 0.5 µm becomes longer by 1e-13 m, 2e-7 of its length. Joint B moves by about this, which
    is reported, as rounding of 0.5 µm is 1e-22 m."""
    path = tmp_path / "small.toml"
    in_other_units(pinned_four_bar(), 1e-6, 1.0).save(path)
    assert main(["assemble", str(path), "--length=A-B=0.5000001e-6"]) == 0
    assert "joint B: moved by" in capsys.readouterr().out


def pinned_four_bar() -> Scene:
    """Return a four-bar of four parallel hinges."""
    scene = find_scene("four_bar_gravity").with_(duration=0.1)
    fields = {"type": "revolute", "axis": (0.0, 0.0, 1.0)}
    pins = [{"name": j.name, "bodies": j.bodies, "anchor": j.anchor_pair[0], **fields} for j in scene.joint]
    return scene.with_(joint=pins)


def test_command_run_refuses_a_file_with_another_ending(tmp_path, capsys):
    """Standard error has one line, and no file is written."""
    assert main(["run", "four_bar", "--duration", "0.01", "--out", str(tmp_path / "run.txt")]) == 2
    said = f"--out: must end in .csv or .json, got '{tmp_path / 'run.txt'}'\n"
    assert capsys.readouterr().err == said and not list(tmp_path.iterdir())


def test_command_animate_draws_the_branches_of_a_crossing_side_by_side(tmp_path, capsys, monkeypatch):
    """The rhombus, driven at 124.8 rad/s from π/2, is flat for the second time after 3/2 π, at 0.0377595 s,
    where it has two branches: the picture of the branches has a panel for each. A picture without --branches
    shows one, and the command says so. The five-bar's first crossing has one branch, and one panel."""
    monkeypatch.chdir(tmp_path)
    assert main(["animate", "four_bar", "--duration", "0.05"]) == 0
    assert "position 2 at t = 0.0377595 s: 2 branches; --branches shows" in capsys.readouterr().out
    assert main(["animate", "four_bar", "--duration", "0.05", "--branches"]) == 0
    picture = (tmp_path / "four_bar-branches.svg").read_text()
    assert "branch 1, smooth" in picture and "branch 2" in picture
    assert main(["animate", "five_bar", "--duration", "0.05", "--crossing", "1"]) == 0
    assert "branch 2" not in (tmp_path / "five_bar-branches.svg").read_text()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            "five_bar --duration 0.05",
            "no singular position up to t = 0.05 s has several branches: "
            "singular position 1 at t = 0.0125865 s: one branch; singular position 2",
        ),
        ("planar_slider_crank --duration 0.1", "the motion passes none"),
        ("four_bar --duration 0.05 --crossing 3", "the singular positions up to t = 0.05 s, got 3"),
        ("planar_slider_crank --duration 0.1 --method mpi-svd+none", "does not detect singular positions"),
    ],
)
def test_command_animate_states_why_there_are_no_branches(words, says, tmp_path, capsys, monkeypatch):
    """The five-bar has one branch at a quarter turn, π/2 / 124.8 s; others pass two or none, or find none."""
    monkeypatch.chdir(tmp_path)
    assert main(["animate", *words.split(), "--branches"]) == 2
    assert says in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_command_list_prints_every_name_within_eighty_columns(capsys):
    """Names of all scenes, formulations, stabilisations and integrators; at most 80 characters a line."""
    assert main(["list"]) == 0
    out = capsys.readouterr().out
    names = (*SCENES, *FORMULATIONS, *STABILISATIONS, *INTEGRATORS)
    assert max(map(len, out.splitlines())) <= 80 and all(f"{name} " in out for name in names)


def test_progress_in_a_pipe_prints_at_most_a_line_in_ten_seconds(capsys):
    """A run of 2 s is at 0.1, 0.5, 0.6 and 1.5 s when the clock shows 1, 12, 13 and 30 s. A quarter in 12 s
    leaves 36 s, and three quarters in 30 s leave 10 s."""
    now = iter([0.0, 1.0, 12.0, 13.0, 30.0])
    lines = Lines("simulating", 2.0, lambda: next(now))
    for done in (0.1, 0.5, 0.6, 1.5):
        lines(done)
    printed = "simulating: 25 %, about 36 s left", "simulating: 75 %, about 10 s left"
    assert capsys.readouterr().err.splitlines() == [*printed]
