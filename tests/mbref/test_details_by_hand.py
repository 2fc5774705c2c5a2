"""Options, defaults and ends of decisions, worked out by hand."""

from __future__ import annotations

import argparse
import io
import math
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref import formats
from mbref.cli import commands, options, pictures
from mbref.design import placed
from mbref.drawing import film, labels, shapes
from mbref.equations.diagnosis import undriven_freedoms
from mbref.equations.model import Model
from mbref.equations.parts import shape_of
from mbref.method import Method, MethodError
from mbref.scene import Body, Factor, JointForce, JointTorque, Scene, Sine, SlideSpring, Spring, TorsionSpring
from mbref.scene_validation import SceneError
from mbref.scenes.four_bar import four_bar
from mbref.simulation import comparison
from mbref.stabilisation import STABILISATIONS
from mbref.trajectory import Cost, Crossing, Outcome, Trajectory

LONE = Scene(name="lone", body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0)),))

# --- options of the command line ---------------------------------------------------------------------------
RUN = "--method --times --samples:int --duration:float --rtol:float=1e-09 --code=auto --max-step:float"
COMMANDS = {  # option:type=default; "!" is a switch, "+" may be given several times
    "": "--version",
    "new": "out:output_file --like",
    "assemble": "scene --length=[]+ --out:output_file",
    "draw": "scene --view --out:output_file",
    "animate": f"scene --view --out:output_file --branches! --crossing:int {RUN}",
    "diagnose": "scene --start! --json!",
    "run": f"scene {RUN} --json! --out:output_file --columns=[]+ --branch=[]+ --estimate=auto",
    "plot": f"scene columns* --out:output_file {RUN}",
    "equilibrium": "scene --starts:int=24 --number:int --json! --out:output_file",
    "modes": "scene --starts:int=24 --number:int --json! --mode:int=1 --view --out:output_file",
    "ensemble": f"scene --vary+ --count:int=100 --seed:int --workers:int --out:output_file {RUN} --json!",
    "import": "file --out:output_file --without= --keyframe= --pose:_coordinate=[]+ --close=[]+ --hold=[]+",
    "export": "scene --out:output_file",
    "list": "what?",
    "completion": "shell",
    "schema": "",
}


def options_of(parser: argparse.ArgumentParser, command: str = "") -> dict[str, list[str]]:
    found: dict[str, list[str]] = {command: []}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, inner in action.choices.items():
                found |= options_of(inner, name)
        elif not isinstance(action, argparse._HelpAction):
            found[command].append(written(action))
    return found


def written(action: argparse.Action) -> str:
    kind = "" if action.type is None else f":{getattr(action.type, '__name__', action.type)}"
    has_default = action.default not in (None, False, argparse.SUPPRESS)
    marks = "+" * isinstance(action, argparse._AppendAction) + "!" * isinstance(
        action, argparse._StoreTrueAction
    )
    name = "/".join(action.option_strings) or action.dest
    return f"{name}{kind}{f'={action.default}' * has_default}{marks}{action.nargs or ''}"


def test_options_of_every_command():
    found = options_of(commands.parser())
    assert {name: " ".join(options) for name, options in found.items()} == COMMANDS


def test_the_module_runs_the_command_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["mbref", "list", "scenes"])
    with pytest.raises(SystemExit) as ended:
        from mbref import __main__  # noqa: F401
    assert ended.value.code == 0 and "four_bar" in capsys.readouterr().out


def test_faults_have_the_lines_of_a_scene_file_alone(tmp_path):
    text = 'name = "a"\n\n[[joint]]\nname = "A"\naxis = [0, 0, 0]\n'
    for name, line in (("a.toml", " (line 5)"), ("a.txt", "")):
        (tmp_path / name).write_text(text)
        options = argparse.Namespace(scene=str(tmp_path / name))
        assert list(commands._with_lines(options, ["joint[0].axis: is zero"])) == [
            f"joint[0].axis: is zero{line}"
        ]
    assert list(commands._with_lines(argparse.Namespace(), ["a"])) == ["a"]
    assert list(commands._with_lines(argparse.Namespace(scene="none.toml"), ["a"])) == ["a"]


@pytest.mark.parametrize(
    ("changed", "names"),
    [({"rtol": -1.0}, "--rtol: "), ({"max_step": -1.0}, "--max-step: "), ({"code": "fast"}, "--code: ")],
)
def test_limits_that_are_refused_name_their_option(changed, names):
    given = argparse.Namespace(**{"rtol": 1e-9, "max_step": 0.5, "code": "generic", **changed})
    with pytest.raises(ValueError, match=rf"^{names}"):
        options.limits_of(given)
    with pytest.raises(ValueError, match=r"^--branch"):
        options.limits_of(argparse.Namespace(rtol=1e-9, max_step=0.5, code="auto"), {1: 0})
    found = options.limits_of(argparse.Namespace(rtol=1e-7, max_step=0.5, code="generic"), {2: 3})
    assert (found.rtol, found.largest_step, found.code, dict(found.branches)) == (
        1e-7,
        0.5,
        "generic",
        {2: 3},
    )


def test_options_of_an_import():
    given = argparse.Namespace(without=" limits,, contacts ,", keyframe="up", pose=[("A", 1.0), ("A", 2.0)])
    given.close, given.hold = ["L"], ["trunk"]
    found = formats.import_options(given)
    assert found == formats.ImportOptions(["limits", "contacts"], "up", {"A": 2.0}, ["L"], ["trunk"])


@pytest.mark.parametrize("text", ["knee", "=1", "knee=", "knee=nan", "knee=inf", "knee=bent"])
def test_coordinates_that_are_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="must be joint=value with a number"):
        formats._coordinate(text)


def test_coordinates_of_joints_whose_names_have_an_equals_sign():
    assert formats._coordinate("a=b=-0.5") == ("a=b", -0.5)


@pytest.mark.parametrize("do", ["reads", "writes"])
def test_a_file_of_no_format(monkeypatch, do, tmp_path):
    item = SimpleNamespace(reads=(".in",), writes=(".out", ".also"))
    monkeypatch.setattr(formats, "entry_points", lambda group: [SimpleNamespace(load=lambda: item)])
    call = formats.read if do == "reads" else lambda path: formats.write(LONE, path)
    known = {"reads": r"\.in", "writes": r"\.also, \.out"}[do]
    with pytest.raises(ValueError, match=rf"a\.none: no format {do} \.none; known: {known}"):
        call(tmp_path / "a.none")
    with pytest.raises(ValueError, match=f"no format {do} a name without an ending"):
        call(tmp_path / "a")
    assert formats.is_readable("a.in") and not formats.is_readable("a.out")


# --- methods ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("lm1+none/rk4[step=0]", "option step must be positive, got 0"),
        ("lm1+none/rk4[step=-1]", "option step must be positive, got -1"),
        ("lm1+none/rk4[step=nan]", "option step must be positive, got nan"),
        ("lm1+baumgarte[alpha=-0.5]/rk4", "option alpha must be positive, got -0.5"),
        ("lm1+baumgarte[alpha=x]/rk4", "option alpha must be a number, got 'x'"),
        ("lm1+baumgarte[1,2,3]/rk4", "has no option 'number 3'; it has: alpha, beta"),
        ("lm1+none[1]/rk4", "has no option 'number 1'; it has: none"),
    ],
)
def test_options_of_methods_that_are_refused(text, says):
    with pytest.raises(MethodError) as refused:
        Method.parse(text)
    assert says in str(refused.value)


def test_options_of_methods_by_name_and_by_position():
    method = Method.parse("lm1+baumgarte[0,beta=7]/rk4[step=0.5]")
    assert method.options_of(method.stabilisation) == {"alpha": 0.0, "beta": 7.0}
    assert method.options_of(method.integrator)["step"] == 0.5


def test_facts_of_stabilisations():
    """Projected states satisfy the constraints; projection and partitioning watch the rank."""
    facts = {name: (s.projects, s.watches_rank) for name, s in STABILISATIONS.items()}
    assert facts == {
        "none": (False, False),
        "baumgarte": (False, False),
        "partitioning": (False, True),
        "projection": (True, True),
    }


@pytest.mark.parametrize(
    ("nearest", "loops", "projects", "tolerance", "series", "leaves"),
    [
        (0.1, 1, True, 1e-10, False, False),
        (0.0999, 1, True, 1e-10, False, True),
        (0.0999, 1, True, 1e-10, True, False),
        (0.0999, 0, True, 1e-10, False, False),
        (1.0, 1, False, 1e-10, False, True),
        (1.0, 1, True, 1.0, False, True),
    ],
)
def test_runs_that_may_have_left_their_motion(nearest, loops, projects, tolerance, series, leaves):
    """Loops, and a near singular position, a large tolerance of the rank or no projection."""
    run: Any = SimpleNamespace(
        method=SimpleNamespace(is_series=series, stabilisation=SimpleNamespace(projects=projects)),
        limits=SimpleNamespace(rank_tolerance=tolerance),
        memory=SimpleNamespace(watch=SimpleNamespace(nearest=nearest)),
        model=SimpleNamespace(closed_loops=loops),
    )
    assert comparison.may_leave(run) is leaves


# --- scenes -----------------------------------------------------------------------------------------------
def test_actions_of_loads_along_coordinates():
    torsion = TorsionSpring(joint="A", stiffness=2.0, damping=3.0, natural_angle=0.5)
    assert torsion.action == (2.0, 3.0, 0.5, 0.0)
    slide = SlideSpring(joint="A", stiffness=2.0, damping=3.0, natural_displacement=0.5)
    assert slide.action == (2.0, 3.0, 0.5, 0.0)
    assert TorsionSpring(joint="A", stiffness=2.0).action == (2.0, 0.0, 0.0, 0.0)
    assert SlideSpring(joint="A", stiffness=2.0).action == (2.0, 0.0, 0.0, 0.0)
    assert (
        JointTorque(joint="A", torque=4.0).action == JointForce(joint="A", force=4.0).action == (0, 0, 0, 4.0)
    )


@pytest.mark.parametrize(
    ("factor", "is_constant"),
    [
        (Factor(polynomial=(2.0,)), True),
        (Factor(polynomial=(2.0, 0.0)), True),
        (Factor(polynomial=(2.0, 1.0)), False),
        (Factor(polynomial=(2.0,), sine=Sine(amplitude=0.0, frequency=1.0)), True),
        (Factor(polynomial=(2.0,), sine=Sine(amplitude=0.1, frequency=1.0)), False),
        (Factor(table=((0.0, 1.0), (1.0, 1.0), (2.0, 1.0), (3.0, 1.0))), False),
        (Factor(start=0.5), False),
        (Factor(stop=0.5), False),
    ],
)
def test_functions_that_never_change(factor, is_constant):
    assert factor.is_constant is is_constant


def test_a_motion_is_read_as_it_was_written():
    """Three times and two bodies, each number another."""
    shape, count = (3, 2, 3), iter(range(1000))

    def array(*shape: int) -> np.ndarray:
        return np.array([next(count) for _ in range(math.prod(shape))], dtype=float).reshape(shape)

    parts = ("position", "velocity", "angular_velocity", "acceleration", "angular_acceleration")
    made = Trajectory(
        scene="s",
        engine="e",
        version="1",
        method="m",
        settings={"rtol": 1e-9},
        message="ended",
        t_end=0.5,
        times=array(3),
        bodies=("a", "b"),
        **{name: array(*shape) for name in parts},
        orientation=array(3, 2, 4),
        reactions={"A": array(3, 6)},
        open_reactions={"A": np.array([0, 1, 0, 0, 0, 1])},
        outcome=Outcome.COMPLETED,
        cost=Cost(steps=3),
        crossings=(Crossing(0.25, array(2, 3), array(2, 4), array(1, 2, 3), array(1, 2, 3), 1, "passed"),),
    )
    read = Trajectory.from_record("s", made.to_record())
    for name in (*parts, "times", "orientation"):
        assert getattr(read, name).tolist() == getattr(made, name).tolist(), name
    assert read.reactions["A"].tolist() == made.reactions["A"].tolist()
    assert read.open_reactions["A"].tolist() == [0, 1, 0, 0, 0, 1]
    for name in ("bodies", "outcome", "cost", "settings", "message", "t_end", "method", "engine", "version"):
        assert getattr(read, name) == getattr(made, name), name
    [one], [other] = read.crossings, made.crossings
    assert one.velocity.tolist() == other.velocity.tolist() and one.time == 0.25 and one.sentence == "passed"
    bare = Trajectory.from_record("s", {**made.to_record(), "crossings": None, "reactions": {}})
    assert bare.crossings is None and bare.reactions is None


# --- pictures ---------------------------------------------------------------------------------------------
def test_places_of_a_name_beside_a_moving_bar():
    """A bar of 60 px that lies, stands and lies backwards; a name of two letters."""
    frames = np.array([[[0.0, 0.0], [60.0, 0.0]], [[0.0, 0.0], [0.0, 60.0]], [[60.0, 0.0], [0.0, 0.0]]])
    places = labels._places("ab", False, frames)
    half, reach = labels.LETTER, labels.LINE_HEIGHT / 2 + labels.GAPS[0]
    assert places[0][0] == pytest.approx([60.0 * labels.ALONG[0], -reach])
    assert places[0][2] == pytest.approx([60.0 * (1 - labels.ALONG[0]), reach])
    assert places[0][1] == pytest.approx([half + labels.GAPS[0], 60.0 * labels.ALONG[0]])
    assert places[1] - places[0] == pytest.approx(
        np.array([[0.0, 2 * reach], [-2 * (half + labels.GAPS[0]), 0.0], [0.0, -2 * reach]])
    )


def test_points_of_a_body_that_are_one_within_rounding():
    def points(gap: float) -> int:
        body = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
        ends = (((1.0, 0.0, 0.0), (2.0, 0.0, 0.0)), ((1.0, 0.0, 0.0), (2.0 + gap, 0.0, 0.0)))
        springs = [
            Spring(bodies=("ground", "b"), points=pair, stiffness=1.0, natural_length=1.0) for pair in ends
        ]
        return len(shapes._own_points(Scene(name="s", body=(body,), load=springs), body))

    assert points(0.0) == points(4e-13) == 2, "the point and the origin of the body"
    assert points(6e-13) == 2 and points(1e-11) == 2


def crossing(branches: int) -> Any:
    return SimpleNamespace(time=0.25, velocity=[0.0] * branches, sentence=f"{branches} branches")


def smooth(*branches: int, **changes: object) -> Any:
    parts = {"crossings": tuple(map(crossing, branches)), "t_end": 2.0, "method": "lm1"}
    return SimpleNamespace(**{**parts, **changes})


def test_the_crossing_whose_branches_are_shown():
    assert pictures.chosen_crossing(smooth(1, 2, 3), None) == 2
    assert [pictures.chosen_crossing(smooth(1, 2, 3), k) for k in (1, 3)] == [1, 3]
    assert pictures.of_several_branches(smooth(1, 2, 1, 3)) == [2, 4]
    assert pictures.of_several_branches(smooth(crossings=None)) == []


@pytest.mark.parametrize(
    ("motion", "number", "says"),
    [
        (
            smooth(crossings=None),
            None,
            "--branches: lm1 does not detect singular positions; use --method taylor",
        ),
        (smooth(1, 2), 3, "--crossing: must be at most 2, the singular positions up to t = 2 s, got 3"),
        (smooth(1, 2), 0, "--crossing: must be at most 2, the singular positions up to t = 2 s, got 0"),
        (
            smooth(1),
            None,
            "--branches: no singular position up to t = 2 s has several branches: "
            "singular position 1 at t = 0.25 s: 1 branches",
        ),
        (
            smooth(),
            None,
            "--branches: no singular position up to t = 2 s has several branches: the motion passes none",
        ),
    ],
)
def test_crossings_that_cannot_be_shown(motion, number, says):
    with pytest.raises((ValueError, MethodError), match=r"^--") as refused:
        pictures.chosen_crossing(motion, number)
    assert str(refused.value) == says


def test_images_of_a_film(monkeypatch):
    image = pytest.importorskip("PIL.Image")
    asked = []

    def drawn(*of: object) -> list[str]:
        asked.append(of)
        return ["red", "blue"]

    def png(colour: str, scale: float) -> bytes:
        file = io.BytesIO()
        image.new("RGB", (3, 2), colour).save(file, "PNG")
        return file.getvalue()

    monkeypatch.setattr(film, "frames", drawn)
    monkeypatch.setattr(film, "png", png)
    motion: Any = SimpleNamespace(times=np.array([0.0, 1.0]))
    scene: Any = "scene"
    found = list(film._images(scene, motion, None))
    assert asked == [("scene", motion, None)]
    assert [each.getpixel((0, 0)) for each in found] == [(255, 0, 0), (0, 0, 255)]


# --- scenes at other poses ---------------------------------------------------------------------------------
def test_a_scene_turned_by_a_right_angle():
    """A body turned about z at the origin: its x is y, its y is -x; points and axes of the ground stay."""
    turned = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    body = LONE.body[0]
    other = body.model_copy(update={"name": "c", "position": (5.0, 0.0, 0.0)})
    joints = [
        {
            "type": "revolute",
            "name": "R",
            "bodies": ("ground", "b"),
            "anchor": (0.0, 0.0, 0.0),
            "axis": (0.0, 0.0, 1.0),
        },
        {
            "type": "revolute",
            "name": "S",
            "bodies": ("b", "c"),
            "anchor": (1.0, 0.0, 0.0),
            "axis": (1.0, 0.0, 0.0),
        },
        {
            "type": "universal",
            "name": "U",
            "bodies": ("b", "c"),
            "anchor": (1.0, 2.0, 0.0),
            "axes": ((1, 0, 0), (0, 1, 0)),
        },
        {
            "type": "distance",
            "name": "D",
            "bodies": ("b", "ground"),
            "anchors": ((3.0, 0.0, 0.0), (0.0, 4.0, 0.0)),
        },
    ]
    loads = [
        {"type": "force", "body": "b", "point": (1.0, 0.0, 0.0), "force": (1.0, 0.0, 0.0)},
        {
            "type": "spring",
            "bodies": ("ground", "b"),
            "points": ((2.0, 0.0, 0.0), (0.0, 2.0, 1.0)),
            "stiffness": 1.0,
            "natural_length": 1.0,
        },
        {"type": "torsion_spring", "joint": "R", "stiffness": 2.0, "natural_angle": 0.5},
    ]
    model = Model(LONE.with_(body=(body, other), joint=joints, load=loads))
    q = model.start().copy()
    q[3:7] = turned
    found = placed.placed_with_springs(model, q)
    first, second, universal, distance = found.joint
    assert (first.anchor, first.axis) == ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert second.anchor == (1.0, 0.0, 0.0) and second.axis == pytest.approx((0.0, 1.0, 0.0))
    assert universal.anchor == (1.0, 2.0, 0.0), "of the second body"
    assert universal.axes == ((0.0, 1.0, 0.0), (0.0, 1.0, 0.0))
    assert np.array(distance.anchors) == pytest.approx(np.array([[0.0, 3.0, 0.0], [0.0, 4.0, 0.0]]))
    force, spring, torsion = found.load
    assert force.point == (0.0, 1.0, 0.0) and force.force == (1.0, 0.0, 0.0)
    assert spring.points == ((2.0, 0.0, 0.0), (-2.0, 0.0, 1.0))
    assert torsion.natural_angle == pytest.approx(0.5 - math.pi / 2)
    assert found.body[0].orientation == pytest.approx(turned) and found.body[1].position == (5.0, 0.0, 0.0)


@pytest.mark.parametrize(("places", "length"), [([0.0, 0.3], 0.3), ([1e3, 1e3 + 5e-4, 1e3 + 4e-4], 5e-4)])
def test_the_length_of_a_mechanism_is_its_largest_distance(places, length):
    body = [LONE.body[0].model_copy(update={"name": f"b{x}", "position": (0.0, x, 0.0)}) for x in places]
    assert Model(LONE.with_(body=body)).length == pytest.approx(length, rel=1e-9)


def test_a_mechanism_at_one_point_counts_as_a_metre_long():
    assert Model(LONE).length == 1.0
    body = [LONE.body[0].model_copy(update={"name": name, "position": (7.0, 0.0, 0.0)}) for name in "bc"]
    assert Model(LONE.with_(body=body)).length == 1.0
    anchored = LONE.with_(
        joint=({"type": "spherical", "name": "S", "bodies": ("ground", "b"), "anchor": (0.0, 3.0, 4.0)},)
    )
    assert Model(anchored).length == 5.0


def test_the_name_of_the_fixed_frame_is_reserved():
    with pytest.raises(SceneError, match=r"body\[ground\]\.name: 'ground' is reserved for the fixed frame"):
        LONE.with_(body=(LONE.body[0].model_copy(update={"name": "ground"}),))


def test_freedoms_of_a_flat_four_bar():
    """Flat, it has two velocities; with a driver they are counted beside the flat position."""
    flat = four_bar(0.0)
    assert undriven_freedoms(flat) == 0 and undriven_freedoms(flat.with_(driver=())) == 2
    assert undriven_freedoms(four_bar(0.5).with_(driver=())) == 1


def test_costs_begin_at_zero():
    cost = Cost()
    numbers = (
        cost.seconds,
        cost.build_seconds,
        cost.steps,
        cost.rejected,
        cost.rhs,
        cost.factorisations,
        cost.newton,
    )
    assert numbers == (0.0, 0.0, 0, 0, 0, 0, 0)


def test_times_around_a_crossing():
    """From a quarter of a turn of the fastest body before it to 0.45 turns after it, within the run."""
    turning = np.zeros((2, 3, 3))
    turning[1, 2] = 0.0, 0.0, -2 * math.pi
    at = Crossing(1.0, np.zeros((3, 3)), np.zeros((3, 4)), np.zeros((2, 3, 3)), turning, 1, "passed")
    assert at.instants(9.0, 8) == pytest.approx(np.linspace(0.75, 1.45, 8))
    assert at.instants(1.2, 3) == pytest.approx([0.75, 0.975, 1.2])
    early = Crossing(0.1, np.zeros((3, 3)), np.zeros((3, 4)), np.zeros((2, 3, 3)), turning, 1, "passed")
    assert early.instants(9.0, 2) == pytest.approx([0.0, 0.55])
    still = Crossing(1.0, np.zeros((3, 3)), np.zeros((3, 4)), np.zeros((2, 3, 3)), 0 * turning, 1, "passed")
    assert still.instants(9.0, 4) == pytest.approx([0.0, 3.0, 6.0, 9.0])


def test_scenes_of_one_shape_have_armatures_at_the_same_joints():
    def hinged(armature: float) -> Scene:
        hinge = {
            "type": "revolute",
            "name": "A",
            "bodies": ("ground", "b"),
            "anchor": (0, 0, 0),
            "axis": (0, 0, 1),
        }
        return LONE.with_(joint=({**hinge, "armature": armature},))

    assert shape_of(hinged(0.2)) == shape_of(hinged(0.5)) != shape_of(hinged(0.0))
