"""Answers of functions that other tests reach seldom / values, names and messages worked out by hand."""

from __future__ import annotations

import pickle
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref import actuation, scene_toml, scene_validation
from mbref.cli import scene_files
from mbref.design import exchange, linearisation
from mbref.design.exchange import Weaker
from mbref.drawing import film, plot
from mbref.equations import couplings, reduction
from mbref.equations.joints import driver_primitive
from mbref.error_estimate import ErrorEstimate
from mbref.input_error import InputError
from mbref.joint_motion import joint_motion
from mbref.method import Method, MethodError
from mbref.scene import (
    Body,
    Coupling,
    Distance,
    Inline,
    JointForce,
    Revolute,
    Scene,
    SceneError,
    SlideSpring,
    Spherical,
    TorsionSpring,
    Translational,
)
from mbref.scene_functions import Factor
from mbref.simulation import rounded_numbers, singular_position
from mbref.taylor import geometry

Z = (0.0, 0.0, 1.0)


def body(name: str, *place: float) -> Body:
    return Body(name=name, mass=2.0, inertia=(0.1, 0.2, 0.25), position=place or (1.0, 2.0, 3.0))


def hinge(name: str = "J", first: str = "ground", second: str = "b", **more: Any) -> Revolute:
    return Revolute(name=name, bodies=(first, second), anchor=(0.0, 0.0, 0.0), axis=Z, **more)


SCENE = Scene(name="s", body=(body("b"),), joint=(hinge(),))


# --- loads along joints -----------------------------------------------------------------------------------
def test_loads_along_a_joint_and_their_power(monkeypatch):
    """0.5 of the coordinate and a rate of 2: -3 (0.5 - 0.1) - 0.25 · 2 = -1.7; a force of 4 times 0.5."""
    monkeypatch.setattr(actuation, "joint_motion", lambda scene, motion, joint: joint)
    asked: list[Any] = []
    monkeypatch.setattr(
        actuation,
        "along",
        lambda found, coordinate: asked.append((found, coordinate)) or (np.array([0.5]), np.array([2.0])),
    )
    motion: Any = SimpleNamespace(times=np.array([0.25]))
    numbers = {"joint": "J", "stiffness": 3.0, "damping": 0.25}
    slide = actuation._of_joint(SCENE, motion, 2, SlideSpring(**numbers, natural_displacement=0.1))
    assert slide.force == pytest.approx([-1.7]) and slide.power == pytest.approx([-3.4])
    assert slide.displacement.tolist() == [0.5] and slide.displacement_rate.tolist() == [2.0]
    assert slide.torque is None and slide.angle is None
    turn = actuation._of_joint(SCENE, motion, 2, TorsionSpring(**numbers, natural_angle=0.1))
    assert turn.torque == pytest.approx([-1.7]) and turn.power == pytest.approx([-3.4])
    assert turn.angle.tolist() == [0.5] and turn.rate.tolist() == [2.0] and turn.force is None
    factor = Factor(polynomial=(0.0, 2.0))
    pushed = actuation._of_joint(SCENE, motion, 2, JointForce(joint="J", force=4.0, factor=factor))
    assert pushed.force.tolist() == [2.0] and pushed.power.tolist() == [4.0]
    assert asked == [("J", "displacement"), ("J", "angle"), ("J", "displacement")]


# --- command line -----------------------------------------------------------------------------------------
def test_new_files_are_scene_files_that_do_not_exist(tmp_path):
    options = SimpleNamespace(out=str(tmp_path / "a.txt"), like=None)
    with pytest.raises(InputError, match=r"FILE: must end in \.toml, got '.*a\.txt'"):
        scene_files._new(options)  # type: ignore[arg-type]
    options.out = str(tmp_path / "a.toml")
    (tmp_path / "a.toml").write_text("mine")
    with pytest.raises(InputError, match="exists already and was not changed"):
        scene_files._new(options)  # type: ignore[arg-type]
    assert (tmp_path / "a.toml").read_text() == "mine"


@pytest.mark.parametrize(
    ("text", "pair", "length"),
    [
        ("A-B=0.35", ("A", "B"), 0.35),
        ("A-B-C=2", ("A", "B-C"), 2.0),
        ("X-Y=1e-3", ("X", "Y"), 1e-3),
        ("B-C-A=2", ("B-C", "A"), 2.0),
    ],
)
def test_a_length_between_joints(text, pair, length):
    scene: Any = SimpleNamespace(joint=[SimpleNamespace(name=name) for name in ("A", "B", "B-C")])
    assert scene_files._length(scene, text) == (pair, length)


@pytest.mark.parametrize("text", ["A-B", "A-B=", "A-B=0", "A-B=-1", "A-B=inf", "A-B=nan", "AB=1", "=1"])
def test_a_length_that_is_refused(text):
    with pytest.raises(InputError, match="--length: must be A-B=LENGTH with a positive length in m, got"):
        scene_files._length(SCENE, text)


# --- design -----------------------------------------------------------------------------------------------
def test_a_scene_without_rows_has_no_exchanges():
    assert exchange.exchanges(Scene(name="free", body=(body("b"),))) == []


def test_the_number_of_trials_is_limited(monkeypatch):
    one = Weaker(np.zeros((0, 3)), np.array([[1.0, 0.0]]))
    other = Weaker(np.zeros((0, 3)), np.array([[0.0, 1.0]]))
    choices: Any = {"A": {"x": one, "y": other}, "B": {"x": one, "y": other}}
    pairs = [{"A": "x", "B": "y"}, {"A": "y", "B": "x"}]
    assert list(exchange._of_size(choices, 2, 2)) == pairs
    for most, found in ((2, []), (3, pairs[:1]), (4, pairs[:1]), (5, pairs)):
        monkeypatch.setattr(exchange, "MOST_TRIALS", most)
        assert list(exchange._of_size(choices, 2, 2)) == found, most


def test_a_pose_that_leaves_the_constraints(monkeypatch):
    tangent = linearisation.Tangent.__new__(linearisation.Tangent)
    model = SimpleNamespace(length=0.5, terms=lambda t, q: SimpleNamespace(phi=np.array([0.0, -off])))
    values = {"model": model, "q": np.zeros(7), "units": np.ones(6), "basis": np.eye(6)[:, :1]}
    for name, value in values.items():
        object.__setattr__(tangent, name, value)
    monkeypatch.setattr(linearisation, "displaced", lambda q, x: ("moved", x.tolist()))
    monkeypatch.setattr(linearisation, "solve_positions", lambda model, t, q: (q, None))
    off = linearisation.CLOSED
    assert tangent.pose(np.array([3.0])) == ("moved", [3.0, 0, 0, 0, 0, 0])
    off = 1.01 * linearisation.CLOSED
    with pytest.raises(linearisation.OffConstraints):
        tangent.pose(np.array([3.0]))
    model.length = 2.0
    assert tangent.pose(np.array([3.0]))[0] == "moved", "relative to lengths above 1 m"


def test_armatures_have_names_that_are_free():
    named = Scene(
        name="s",
        body=(body("b"), body("armature of J", 0.0, 1.0, 0.0)),
        joint=(hinge(), hinge("armature of J'", "ground", "armature of J")),
    )
    assert list(couplings._free_names(named, list(named.joint))) == [
        "armature of J''",
        "armature of armature of J'",
    ]


def test_reductions_of_the_latest_structures_are_kept(monkeypatch):
    kept: dict[Any, Any] = {}
    monkeypatch.setattr(reduction, "_known", kept)
    monkeypatch.setattr(reduction, "MOST_STRUCTURES", 2)
    monkeypatch.setattr(reduction, "MOST_OF_ONE", 2)
    monkeypatch.setattr(reduction, "_found", lambda model, start: made.pop(0))

    def decided(name: str) -> Any:
        decisions = SimpleNamespace(
            terms=lambda model, start: SimpleNamespace(blocks=np.full((1, 3, 2), 7.0)),
            agrees=lambda model, start, terms: start.name == name,
        )
        return SimpleNamespace(decisions=decisions, name=name)

    def model(structure: str) -> Any:
        return SimpleNamespace(
            structure=structure, terms=lambda t, q, v: SimpleNamespace(blocks=("at", t, q, v))
        )

    start = lambda name: SimpleNamespace(name=name, q="q", v="v")  # noqa: E731
    made = [decided(name) for name in "abcde"]
    found, blocks = reduction.reduction_of(model("S"), start("a"))  # type: ignore[arg-type]
    assert found.name == "a" and blocks == ("at", 0.0, "q", "v")
    again, blocks = reduction.reduction_of(model("S"), start("a"))  # type: ignore[arg-type]
    assert again is found and blocks.tolist() == [7.0, 7.0] and len(made) == 4
    reduction.reduction_of(model("S"), start("b"))  # type: ignore[arg-type]
    reduction.reduction_of(model("S"), start("c"))  # type: ignore[arg-type]
    assert [each.name for each in kept["S"]] == ["c", "b"]
    reduction.reduction_of(model("T"), start("d"))  # type: ignore[arg-type]
    assert [*kept] == ["S", "T"]
    reduction.reduction_of(model("U"), start("e"))  # type: ignore[arg-type]
    assert [*kept] == ["T", "U"]


def test_the_latest_geometries_are_kept(monkeypatch):
    kept: dict[Any, Any] = dict.fromkeys(range(62))
    monkeypatch.setattr(geometry, "_known", kept)
    monkeypatch.setattr(geometry, "_key", lambda model, start, moving: model)
    monkeypatch.setattr(geometry, "pose_of", lambda q: f"pose {q}")
    monkeypatch.setattr(geometry, "OneScene", lambda: "one")
    monkeypatch.setattr(geometry, "NaturalCoordinates", lambda *given: given)
    monkeypatch.setattr(geometry, "Geometry", lambda coordinates: ["geometry", *coordinates])
    start: Any = SimpleNamespace(q="q")
    of = lambda name, driven=False: geometry.geometry_of(name, start, "moving", driven)  # type: ignore[arg-type]  # noqa: E731
    first = of("a")
    assert first == ["geometry", "a", "pose q", "moving", False, "one"] and of("a") is first
    assert of("a", True) is not first and [*kept] == [*range(62), (False, "a"), (True, "a")]
    of("b")
    assert [*kept] == [*range(1, 62), (False, "a"), (True, "a"), (False, "b")] and of("a") is first
    kept.pop((False, "a"))
    assert of("a") is not first and len(kept) == 64


# --- drawing ----------------------------------------------------------------------------------------------
def test_pictures_without_their_libraries(monkeypatch):
    monkeypatch.setitem(sys.modules, "resvg_py", None)
    with pytest.raises(InputError, match="PNG needs resvg: pip install"):
        film.png("<svg/>")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ImportError, match="plot needs matplotlib"):
        plot.plot({"time": np.zeros(1), "energy.total": np.zeros(1)}, [])


# --- messages ---------------------------------------------------------------------------------------------
def test_faults_of_scenes_are_sentences():
    assert pickle.loads(pickle.dumps(SceneError(["a", "b"]))).faults == ["a", "b"]
    assert str(SceneError(["a", "b"])) == "a\nb"
    assert scene_validation._must_hold(("load", 0, "table", 2), "3") == "must be a time and a value, got 3"
    assert scene_validation._must_hold(("body", 0, "position"), "3") == "must be three numbers, got 3"
    assert scene_validation._must_hold((), "3") == "must be three numbers, got 3"
    with pytest.raises(SceneError, match="joint 'J': joints of type 'spherical' cannot be driven"):
        driver_primitive(Spherical(name="J", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0)))
    with pytest.raises(KeyError, match="none"):
        SCENE.joint_named("none")
    assert SCENE.joint_named("J") is SCENE.joint[0]
    with pytest.raises(SceneError, match="two different points"):
        Scene(
            name="s",
            body=(body("b"),),
            joint=({"type": "distance", "name": "J", "bodies": ["ground", "b"], "anchors": [[1, 1, 1]] * 2},),
        )
    apart = Distance(name="J", bodies=("ground", "b"), anchors=((0, 0, 0), (0, 0, 1e-3)))
    assert apart.anchor_pair == ((0, 0, 0), (0, 0, 1e-3))


def coupled(**changes: Any) -> list[str]:
    given = {"name": "C", "joints": ["J", "K"], "ratio": 2.0, **changes}
    slide = Translational(name="K", bodies=("ground", "c"), anchor=(0.0, 0.0, 0.0), axis=Z)
    try:
        Scene(name="s", body=(body("b"), body("c")), joint=(hinge(), slide), coupling=(given,))
    except SceneError as error:
        return error.faults
    return []


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({}, ""),
        ({"ratio": 0.0}, "must not be 0, which would lock the second joint"),
        ({"name": "J"}, "coupling[J].name: 'J' is already the name of a joint"),
        ({"joints": ["J"]}, "coupling[C].joints: must be two names of joints"),
        (
            {"joints": ["J", "J"], "coordinates": ["angle", "angle"]},
            "must be two different coordinates, got the angle of 'J' twice",
        ),
        ({"coordinates": ["displacement", "angle"]}, "which has no displacement to be coupled"),
        ({"offset": "30 deg"}, "coupling[C].offset: is of the displacement of 'K', got '30 deg'"),
        ({"offset": "3 mm"}, ""),
    ],
)
def test_couplings_that_are_refused(changes, fault):
    faults = coupled(**changes)
    assert (len(faults) == 1 and fault in faults[0]) if fault else not faults, faults


def test_a_coupling_keeps_its_numbers():
    made = Coupling(name="C", joints=("J", "K"), ratio=-2.0)
    assert made.ratio == -2.0 and made.offset == 0.0


@pytest.mark.parametrize(
    ("fault", "line"),
    [("no path", None), ("body[1].mass: is missing", 4), ("gravity: must be", 1), ("body[b].mass: is", 4)],
)
def test_lines_of_faults(fault, line):
    lines = [(1, "", 0, "gravity"), (2, "body", 0, ""), (3, "body", 0, "mass"), (4, "body", 1, "")]
    names = {("body", "b"): 1}
    assert scene_toml._line_of(lines, names, fault) == line  # type: ignore[arg-type]


def test_an_estimate_shows_its_sentence():
    estimate = ErrorEstimate.none(np.zeros(2), 1e-9, "the run has no sample")
    assert repr(estimate) == f"<ErrorEstimate: {estimate.sentence}>" and "no sample" in repr(estimate)
    assert np.isnan(estimate.error).all() and estimate.error.size == 2


def test_the_series_needs_projection():
    with pytest.raises(MethodError, match=r"integrator taylor projects every step: use it with \+projection"):
        Method.parse("mpi-svd+none/taylor")


def test_advice_on_rounded_numbers(monkeypatch):
    run: Any = SimpleNamespace(
        model=SimpleNamespace(m=rounded_numbers.MOST_ADVISED_ROWS),
        start=SimpleNamespace(q=np.array([4.0, -8.0])),
    )
    least = rounded_numbers.LEAST_GAP * np.finfo(float).eps * 8.0
    for gap, advised in ((0.99 * least, 0), (1.01 * least, 1), (0.99 * rounded_numbers.MOST_GAP, 1)):
        monkeypatch.setattr(rounded_numbers, "gap_of", lambda run, gap=gap: gap)
        assert bool(rounded_numbers.advice(run)) is bool(advised)
    run.model.m += 1
    assert rounded_numbers.advice(run) == ""
    run.model.m = 1
    monkeypatch.setattr(rounded_numbers, "gap_of", lambda run: rounded_numbers.MOST_GAP)
    assert rounded_numbers.advice(run) == ""


def test_the_last_accepted_state_of_a_run():
    start = SimpleNamespace(q="q", v="v")
    previous = SimpleNamespace(coordinates=np.array([1.0]), velocities=np.array([2.0]))
    clock = SimpleNamespace(time=0.0)
    run: Any = SimpleNamespace(
        start=start, memory=SimpleNamespace(loop=SimpleNamespace(clock=clock), previous=previous)
    )
    assert singular_position._accepted(run) == ("q", "v")
    clock.time = 0.5
    q, v = singular_position._accepted(run)
    assert q.tolist() == [1.0] and v.tolist() == [2.0] and q is not previous.coordinates


def test_a_displacement_is_along_the_axis_that_the_first_body_carries():
    """The first body turns by 0.3 rad about z, the second one by 1.1 rad about x, 0.7 m along the axis."""
    line = Inline(name="J", bodies=("a", "b"), anchor=(1.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0))
    scene = Scene(name="s", body=(body("a", 0.0, 0.0, 0.0), body("b", 1.0, 0.0, 0.0)), joint=(line,))
    c, s = np.cos(0.3), np.sin(0.3)
    at, still = np.array([0.2, 0.1, 0.0]), [1.0, 0.0, 0.0, 0.0]
    motion: Any = SimpleNamespace(
        times=np.array([0.0, 0.5]),
        bodies=("a", "b"),
        position=np.array([[[0, 0, 0], [1, 0, 0]], [at, at + 1.7 * np.array([c, s, 0.0])]]),
        orientation=np.array(
            [[still, still], [[np.cos(0.15), 0, 0, np.sin(0.15)], [np.cos(0.55), np.sin(0.55), 0, 0]]]
        ),
        velocity=np.array([[[0.0] * 3] * 2, [[1, 2, 0], [3, -1, 0]]]),
        angular_velocity=np.array([[[0.0] * 3] * 2, [[0, 0, 0.5], [0.4, 0, 0]]]),
        reactions=None,
        open_reactions=None,
    )
    found = joint_motion(scene, motion, "J")
    assert found.displacement == pytest.approx([0.0, 0.7])
    assert found.displacement_rate == pytest.approx([0.0, 2 * c - 3 * s])
    assert found.angle is None and found.rate is None


def near_run(loops: int, reference: float, smallest: float) -> Any:
    watch = SimpleNamespace(reference_pivot=reference, smallest_pivot=smallest)
    return SimpleNamespace(memory=SimpleNamespace(watch=watch), model=SimpleNamespace(closed_loops=loops))


def test_a_run_that_ends_near_a_singular_position():
    near = singular_position.NEAR_PIVOT * 0.5
    for loops, reference, smallest, is_near in (
        (1, 0.5, 0.99 * near, True),
        (1, 0.5, near, False),
        (0, 0.5, 0.99 * near, False),
        (1, 0.0, -1.0, False),
    ):
        assert singular_position.is_near(near_run(loops, reference, smallest)) is is_near


@pytest.mark.parametrize(
    ("inside", "part", "rows", "time", "q", "v", "joints"),
    [
        (True, 0.25, 1, 2.125, 7.0, [1.5, -1.0], ("rank 4", 2.125, 7.0)),
        (False, 0.25, 1, 2.0, 3.0, [1.0, -2.0], ("rank 4", 2.0, 3.0)),
        (True, 0.0, 1, 2.0, 3.0, [1.0, -2.0], ("rank 4", 2.0, 3.0)),
        (True, 0.25, 10**6, 2.125, 7.0, [1.5, -1.0], ()),
    ],
)
def test_the_singular_position_inside_a_step(monkeypatch, inside, part, rows, time, q, v, joints):
    """A quarter of a step from 2 s to 2.5 s, in which velocities change from (1, -2) to (3, 2)."""
    run: Any = SimpleNamespace(
        memory=SimpleNamespace(
            loop=SimpleNamespace(
                clock=SimpleNamespace(time=2.0, attempt_end=2.5), ends=SimpleNamespace(pose=np.array([7.0]))
            ),
            watch=SimpleNamespace(singular_part=part),
            state=SimpleNamespace(velocities=np.array([3.0, 2.0])),
        ),
        model=SimpleNamespace(m=rows),
    )
    monkeypatch.setattr(singular_position, "_accepted", lambda run: (np.array([3.0]), np.array([1.0, -2.0])))
    monkeypatch.setattr(singular_position, "_rank", lambda run, t, q: 4 * (t == 2.0) * (q[0] == 3.0))
    monkeypatch.setattr(singular_position, "_joints", lambda run, t, q, rank: (f"rank {rank}", t, q[0]))
    found = singular_position.met_by(run, inside)
    assert found.time == time and found.coordinates.tolist() == [q] and found.velocities.tolist() == v
    assert found.joints == joints


def test_joints_whose_rows_lose_rank():
    """Two parallel unit rows of joints B and C: the lost combination has equal parts of both."""
    jacobian = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 3.0, 0.0]])
    terms = SimpleNamespace(jacobian=jacobian)
    model = SimpleNamespace(
        terms=lambda t, q: terms, m=3, data=SimpleNamespace(metric_root=np.ones(3)), row_joint=("A", "B", "C")
    )
    run: Any = SimpleNamespace(
        model=model,
        limits=SimpleNamespace(rank_tolerance=1e-9),
        memory=SimpleNamespace(watch=SimpleNamespace(generic_rank=0)),
    )
    assert singular_position._rank(run, 0.5, "q") == 2  # type: ignore[arg-type]
    assert singular_position._joints(run, 0.5, "q", 3) == ("B", "C")  # type: ignore[arg-type]
    assert singular_position._joints(run, 0.5, "q", 2) == ("A", "B", "C")  # type: ignore[arg-type]
    run.memory.watch.generic_rank = 3
    assert singular_position._rank(run, 0.5, "q") == 3  # type: ignore[arg-type]
    terms.jacobian = np.zeros((3, 3))
    run.memory.watch.generic_rank = 0
    assert singular_position._rank(run, 0.5, "q") == 1  # type: ignore[arg-type]
    values, _ = singular_position._singular_values(run, 0.5, "q")  # type: ignore[arg-type]
    assert values.size == 6
