"""What rows hold at rest: what is found, and that motion and reactions are those of all equations."""

import numpy as np
import pytest

from crosscheck.random_mechanisms import random_mechanism
from mbref.method import Method
from mbref.run import Run
from mbref.scene import Body, Driver, Revolute, Scene, Spring, Translational
from mbref.scenes import SCENES, find_scene
from mbref.simulate import Limits, simulate
from mbref.sparse.held import held_by_rows
from mbref.sparse.moving import moving_entries

METHOD = "alf-dual+projection"
GUIDED = Scene(
    name="guided",
    gravity=(0.0, -9.81, 0.0),
    body=(
        Body(name="arm", mass=1.0, inertia=(0.01, 0.02, 0.03), position=(0.1, 0.0, 0.0)),
        Body(name="sleeve", mass=0.5, inertia=(0.01, 0.02, 0.03), position=(0.3, 0.0, 0.0)),
    ),
    joint=(
        Revolute(name="pin", bodies=("ground", "arm"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),
        Translational(name="guide", bodies=("arm", "sleeve"), anchor=(0.3, 0.0, 0.0), axis=(1.0, 0.0, 0.0)),
    ),
    load=(
        Spring(
            bodies=("ground", "sleeve"), points=((0, 0, 0), (0, 0, 0)), stiffness=20.0, natural_length=0.3
        ),
    ),
    duration=0.5,
)  # fmt: skip


def held(scene):
    """The columns that rows hold, as body and axis: x, y, z of its position, a, b, c of its own frame."""
    run = Run(scene, Method.parse(METHOD), np.array([0.1]), Limits())
    moving, entries = moving_entries(run.model, run.start.q, run.start.v)
    found, left = held_by_rows(run.model, run.start.q, moving, entries)
    columns = [column for each in found for column in each.columns]
    assert all(len(each.rows) == len(each.columns) for each in found)
    assert not set(columns) & set(run.moving.velocities), "what is held is not integrated"
    assert not (left & ~entries).any()
    return {f"{run.model.bodies[c // 6].name} {'xyzabc'[c % 6]}" for c in columns}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("planar_slider_crank", {"slider y"}),
        ("spatial_slider_crank", {"crank y", "crank a", "crank c", "slider x", "slider z"}),
        ("spatial_slider_crank_driven", {"crank y", "crank a", "crank c", "slider x", "slider z"}),
        ("spatial_slider_crank_gravity", {"crank y", "crank a", "crank c", "slider x", "slider z"}),
        ("four_bar", set()),
    ],
)
def test_sides_of_guides_and_other_axes_of_cranks_are_held(name, expected):
    assert held(SCENES[name]()) == expected


def test_a_guide_that_turns_holds_nothing_and_a_driven_way_is_not_held():
    assert held(GUIDED) == set()
    driven = GUIDED.with_(
        body=GUIDED.body[1:],
        joint=(GUIDED.joint[1].model_copy(update={"bodies": ("ground", "sleeve")}),),
        driver=(Driver(joint="guide", polynomial=(0.0, 0.1)),),
    )
    assert held(driven) == {"sleeve y", "sleeve c"}, "all but the driven way"


MECHANISMS = (
    *(SCENES[name]() for name in ("planar_slider_crank_gravity", "spatial_slider_crank_gravity")),
    SCENES["spatial_slider_crank_driven"](), find_scene("slider_crank_chain[3]"), GUIDED,
)  # fmt: skip


@pytest.mark.parametrize(
    ("scene", "code"),
    [
        *((scene, code) for scene in MECHANISMS for code in ("generic", "specialised")),
        *((random_mechanism(seed), "generic") for seed in range(8)),
    ],
    ids=lambda value: value if isinstance(value, str) else value.name,
)
def test_accelerations_and_multipliers_satisfy_all_equations_of_motion(scene, code):
    """M q̈ + Φ_qᵀ λ = g in every column, those held too, whose only equation this is."""
    run = Run(scene, Method.parse(METHOD), np.linspace(0.0, 0.05, 6), Limits(code=code))
    run.march(None)
    for t, q, v, acceleration, multipliers in zip(run.times, *run.samples, strict=True):
        terms = run.model.terms(t, q, v)
        left = terms.mass * acceleration + terms.jacobian.T @ multipliers - terms.force
        size = np.abs(terms.force).max() + np.abs(terms.mass * acceleration).max()
        assert np.abs(left).max() < 1e-9 * size, f"t = {t:g}: {np.abs(left).max():.1e} of {size:.1e}"


@pytest.mark.parametrize("scene", [SCENES["spatial_slider_crank_gravity"](), GUIDED], ids=lambda s: s.name)
def test_motion_and_reactions_are_those_of_all_equations_solved_together(scene):
    times = np.linspace(0.0, 0.1, 5)
    one, other = (simulate(scene, method, times, Limits(rtol=1e-11)) for method in (METHOD, "lm1+none"))
    np.testing.assert_allclose(one.position, other.position, atol=1e-8)
    for joint, reaction in one.reactions.items():
        size = np.abs(other.reactions[joint]).max()
        np.testing.assert_allclose(reaction, other.reactions[joint], atol=1e-6 * size, err_msg=joint)
