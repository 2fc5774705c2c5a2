"""Statically determined rows: those found, and that motion and reactions are those of all equations."""

import numpy as np
import pytest

from crosscheck.conformance.random_mechanisms import random_mechanism
from mbref.equations.active_coordinates import active_entries
from mbref.equations.static_constraints import SMALL, _perpendicular, held_by_rows
from mbref.method import Method
from mbref.scene import Body, Driver, Fixed, Force, Revolute, Scene, Spring, Translational
from mbref.scenes import SCENES, find_scene
from mbref.simulation.simulate import Limits, simulate
from mbref.simulation.start_run import start_run

METHOD = "alf-dual+projection"
ORIGIN, X, Z = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
GRAVITY = {"gravity": (0.0, -9.81, -3.0), "duration": 0.5}


def block(name, x):
    return Body(name=name, mass=1.0, inertia=(0.01, 0.02, 0.03), position=(x, 0.0, 0.0))


def guide(name, bodies, x):
    return Translational(name=name, bodies=bodies, anchor=(x, 0.0, 0.0), axis=X)


def oblique(body):
    """A spring from above and beside that also turns the body."""
    points = ((0.3, 0.5, 0.2), (0.02, 0.01, 0.03))
    return Spring(bodies=("ground", body), points=points, stiffness=20.0, natural_length=0.3)


RAIL = Scene(
    name="rail",
    body=(block("slide", 0.0),),
    joint=(guide("guide", ("ground", "slide"), 0.0),),
    load=(oblique("slide"),),
    **GRAVITY,
)
TWO_GUIDES = RAIL.with_(name="two_guides", joint=(*RAIL.joint, guide("other", ("ground", "slide"), 0.4)))
SLEEVE = Scene(
    name="sleeve",
    body=(block("arm", 0.1), block("sleeve", 0.3)),
    joint=(
        Revolute(name="pin", bodies=("ground", "arm"), anchor=ORIGIN, axis=Z),
        guide("guide", ("arm", "sleeve"), 0.3),
    ),
    load=(oblique("sleeve"),),
    **GRAVITY,
)
WELD = Scene(
    name="weld",
    body=(block("a", 0.0), block("b", 1.0)),
    joint=(
        Fixed(name="root", bodies=("ground", "a"), anchor=ORIGIN),
        Fixed(name="tip", bodies=("a", "b"), anchor=(0.5, 0.0, 0.0)),
    ),
    load=(oblique("b"),),
    **GRAVITY,
)


def held(scene):
    """The columns that rows hold, as body and axis: x, y, z of its position, a, b, c of its own frame."""
    run = start_run(scene, Method.parse(METHOD), np.array([0.1]), Limits())
    moving, entries = active_entries(run.model, run.start.q, run.start.v)
    found, left = held_by_rows(run.model, run.start, moving, entries)
    columns = [column for each in found for column in each.columns]
    assert all(len(each.rows) == len(each.columns) for each in found)
    assert not set(columns) & set(run.memory.active.velocities), "what is held is not integrated"
    assert not (left & ~entries).any()
    return {f"{run.model.bodies[c // 6].name} {'xyzabc'[c % 6]}" for c in columns}


SPATIAL = {"crank y", "crank a", "crank c", "slider x", "slider z"}
SIDES = {f"slide {axis}" for axis in "yzabc"}


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        (SCENES["planar_slider_crank"](), {"slider y"}),
        (SCENES["spatial_slider_crank"](), SPATIAL),
        (SCENES["spatial_slider_crank_driven"](), SPATIAL),
        (SCENES["spatial_slider_crank_gravity"](), SPATIAL),
        (SCENES["four_bar"](), set()),
        (RAIL, SIDES),
        (WELD, {f"{body} {axis}" for body in "ab" for axis in "xyzabc"}),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_sides_of_guides_and_other_axes_of_cranks_are_held(scene, expected):
    assert held(scene) == expected


def test_a_driven_way_is_not_held_and_one_driven_to_rest_is():
    driven, at_rest = (
        RAIL.with_(driver=(Driver(joint="guide", polynomial=(0.0, speed)),)) for speed in (0.1, 0.0)
    )
    assert held(driven) == SIDES
    assert held(at_rest) == {*SIDES, "slide x"}


def test_redundant_rows_hold_nothing():
    assert held(TWO_GUIDES) == set()


def test_a_column_without_mass_is_not_held():
    thin = RAIL.body[0].model_copy(update={"inertia": (0.0, 0.02, 0.02)})
    assert held(RAIL.with_(body=(thin,))) == SIDES - {"slide a"}


def test_a_sleeve_on_a_turning_arm_is_not_held():
    assert not {column for column in held(SLEEVE) if column in ("sleeve x", "sleeve y", "sleeve c")}


def test_rows_of_changing_length_or_at_an_angle_do_not_hold():
    constant, changing = np.array([[1.0, 0], [0, 1], [1, 0]]), np.array([[0.0, 1], [1, 0], [0, 0.9]])
    assert _perpendicular(np.array([constant, constant[:, ::-1]])) == [0, 1]
    assert _perpendicular(np.array([constant, changing])) == [0]
    assert _perpendicular(np.array([constant, constant[:, ::-1] + 1e-6])) == [0]
    assert _perpendicular(np.array([1e-6 * constant, 1e-6 * constant[:, ::-1] + 1e-12])) == [0]
    assert _perpendicular(np.array([0.1 * SMALL * constant])) == []
    assert _perpendicular(np.array([constant, [[0, 0], [1, 0], [0, 1]]])) == [0], "a row that vanishes"


@pytest.mark.parametrize(
    "scene", [RAIL, SLEEVE, WELD, TWO_GUIDES, *map(random_mechanism, range(12))], ids=lambda scene: scene.name
)
def test_what_is_held_cannot_move_at_any_pose_of_the_motion(scene):
    """Φ_q v = 0 has no solution that moves it: the null space has zeros there, wherever the rest goes."""
    run = start_run(scene, Method.parse(METHOD), np.linspace(0.0, 0.05, 4), Limits())
    moving, entries = active_entries(run.model, run.start.q, run.start.v)
    found, _ = held_by_rows(run.model, run.start, moving, entries)
    columns = [column for each in found for column in each.columns]
    run.stepper.advance(None)
    for q in run.memory.loop.samples.coordinates:
        _, sizes, right = np.linalg.svd(run.model.terms(0.0, q, run.start.v).jacobian)
        null_space = right[np.sum(sizes > 1e-9 * sizes[0]) :]
        assert np.abs(null_space[:, columns]).max(initial=0.0) < 1e-8


NAMES = ("planar_slider_crank_gravity", "spatial_slider_crank_gravity", "spatial_slider_crank_driven")
MECHANISMS = (*(SCENES[name]() for name in NAMES), RAIL, SLEEVE, WELD, TWO_GUIDES)


@pytest.mark.parametrize(
    ("scene", "method"),
    [
        *((scene, METHOD) for scene in MECHANISMS),
        (RAIL, "alf-dual+none"),
        (find_scene("slider_crank_chain[3]"), METHOD),
        *((random_mechanism(seed), METHOD) for seed in range(8)),
    ],
    ids=lambda value: value if isinstance(value, str) else value.name,
)
def test_accelerations_and_multipliers_satisfy_all_equations_of_motion(scene, method):
    """M q̈ + Φ_qᵀ λ = g in every column, those held too, whose only equation this is."""
    run = start_run(scene, Method.parse(method), np.linspace(0.0, 0.05, 6), Limits())
    run.stepper.advance(None)
    for t, q, v, acceleration, multipliers in zip(run.times, *run.memory.loop.samples, strict=True):
        terms = run.model.terms(t, q, v)
        left = terms.mass * acceleration + terms.jacobian.T @ multipliers - terms.force
        size = np.abs(terms.force).max() + np.abs(terms.mass * acceleration).max()
        assert np.abs(left).max() < 1e-9 * size, f"t = {t:g}: {np.abs(left).max():.1e} of {size:.1e}"


@pytest.mark.parametrize(
    "scene", [MECHANISMS[1], RAIL, SLEEVE, WELD, TWO_GUIDES], ids=lambda scene: scene.name
)
def test_motion_and_reactions_are_those_of_all_equations_solved_together(scene):
    """Where rows are redundant too, which share as they do in the dense least-norm solution."""
    times = np.linspace(0.0, 0.1, 5)
    one = simulate(scene, METHOD, times, Limits(rtol=1e-11))
    other = simulate(scene, "mpi-svd+none", times, Limits(rtol=1e-11))
    np.testing.assert_allclose(one.position, other.position, atol=1e-8)
    for joint, reaction in one.reactions.items():
        size = np.abs(other.reactions[joint]).max()
        np.testing.assert_allclose(reaction, other.reactions[joint], atol=1e-5 * size, err_msg=joint)


def test_a_driver_that_works_against_what_would_be_held_is_not_passed_over():
    """Its rate is zero at the start, which is therefore consistent."""
    scene = Scene(
        name="against",
        body=(block("a", 0.0), block("b", 1.0)),
        joint=(
            Revolute(name="p", bodies=("ground", "a"), anchor=ORIGIN, axis=Z),
            Fixed(name="w", bodies=("ground", "a"), anchor=ORIGIN),
            Revolute(name="r", bodies=("a", "b"), anchor=(0.5, 0.0, 0.0), axis=Z),
        ),
        driver=(Driver(joint="p", polynomial=(0.0, 0.0, 5.0)),),
        **GRAVITY,
    )
    run = simulate(scene, METHOD, [0.0, 0.2])
    assert run.outcome.name != "COMPLETED", "the driver cannot turn what is welded"


def test_primitives_that_only_hold_columns_are_evaluated_at_samples():
    scene, times = find_scene("spatial_slider_crank_gravity"), np.linspace(0.0, 0.1, 4)
    run = start_run(scene, Method.parse(METHOD), times, Limits())
    resting = run.memory.equations.scene.resting
    assert resting.size == 4, "the directions of the revolute and of the translational joint hold columns"
    found, dense = (
        simulate(scene, f"{f}+projection", times, Limits(rtol=1e-11)) for f in ("alf-dual", "lm2")
    )
    for joint in scene.joint:
        ours, theirs = found.reactions[joint.name], dense.reactions[joint.name]
        assert np.abs(ours - theirs).max() < 1e-8 * np.abs(theirs).max(), joint.name


@pytest.mark.parametrize("formulation", ["alf-dual", "lm2"])
@pytest.mark.parametrize("stabilisation", ["none", "partitioning"])
def test_all_primitives_are_evaluated_where_all_gradients_are_read(formulation, stabilisation):
    scene = find_scene("spatial_slider_crank_gravity")
    run = start_run(scene, Method.parse(f"{formulation}+{stabilisation}"), np.array([0.1]), Limits())
    assert run.memory.equations.scene.resting.size == 0


def entries(scene):
    """Coordinates and velocities that are integrated."""
    run = start_run(scene, Method.parse(METHOD), np.array([0.1]), Limits())
    return run.memory.active.coordinates.size, run.memory.active.velocities.size


def test_planar_mechanisms_keep_the_entries_of_their_plane():
    assert entries(SCENES["planar_slider_crank"]()) == (9, 7)
    assert entries(SCENES["five_bar"]()) == (16, 12)
    assert entries(SCENES["spatial_slider_crank"]()) == (12, 10), "its crank and its slider move in one way"
    pushed = SCENES["planar_slider_crank"]()
    pushed = pushed.with_(load=(*pushed.load, Force(body="rod", point=(0.2, 0, 0), force=(0, 0, 1e-9))))
    assert entries(pushed) == (16, 14), "redundant rows share a force across the plane, however small"


def test_a_body_without_joints():
    body = Body(name="b", position=(0, 0, 0), mass=2, inertia=(1, 2, 3))
    scene = Scene(name="thrown", gravity=(0, -9.81, 0), body=(body,))
    fall = simulate(scene, METHOD, (0.5,))
    assert fall.outcome.name == "COMPLETED", fall.message
    assert abs(fall.position[-1, 0, 1] + 0.5 * 9.81 * 0.25) < 1e-12


@pytest.mark.parametrize("method", (METHOD, "lm2+projection/adams", "taylor"))
def test_a_body_that_cannot_move(method):
    body = Body(name="b", position=(1, 0, 0), mass=2, inertia=(1, 2, 3))
    weld = Fixed(name="W", bodies=("ground", "b"), anchor=(0, 0, 0))
    scene = Scene(name="welded", gravity=(0, -9.81, 0), joint=(weld,), body=(body,))
    rest = simulate(scene, method, (0.0, 1.0))
    assert rest.outcome.name == "COMPLETED", rest.message
    assert np.abs(rest.position[-1] - [[1, 0, 0]]).max() < 1e-13
    assert abs(np.abs(rest.reactions["W"][-1, 1]) - 2 * 9.81) < 1e-9
