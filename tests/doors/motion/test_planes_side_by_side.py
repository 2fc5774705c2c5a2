"""Links side by side in parallel planes move as in one plane; joints carry the moments between them."""

import numpy as np
import pytest

from mbref import Limits, rotations, simulate
from mbref.scene import Force, Scene
from mbref.scenes import find_scene
from mbref.scenes.planar_slider_crank import slider_crank
from tests.helpers.changed_scenes import in_another_frame
from tests.helpers.coupled_mechanisms import body
from tests.helpers.newton_euler import unbalanced
from tests.helpers.parts import hinge, joint

METHOD = "alf-dual+projection"
UNBALANCED = 1e-8  # N or N m left of the balance of a body, over the largest: 100 tolerances of the run
TIMES = (0.0, 0.02, 0.05)


def run_of(scene: Scene, method: str = METHOD, times=TIMES):
    run = simulate(scene, method, times, Limits(rtol=1e-10))
    assert run.outcome.name == "COMPLETED", run.message
    return run


@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("strandbeest[2]", METHOD),
        ("strandbeest[2]", "alf-dual+baumgarte"),
        ("slider_crank_chain[2]", METHOD),
        ("strandbeest[9]", METHOD),  # the crank is split into copies
    ],
)
def test_planes_apart_move_as_in_one_plane_and_their_joints_carry_moments(name, method):
    """The same scene with all parts at z = 0 has the same motion. Positions (m) agree to a tenth of the run's
    tolerance, 1e-10, and angular velocities (rad/s) to ten times it. Reactions balance every body by Newton's
    and Euler's equations, which needs moments out of the plane."""
    scene = find_scene(name)
    bodies = tuple(each.model_copy(update={"position": (*each.position[:2], 0.0)}) for each in scene.body)
    joints = tuple(each.model_copy(update={"anchor": (*each.anchor[:2], 0.0)}) for each in scene.joint)
    apart, flat = run_of(scene, method), run_of(scene.with_(body=bodies, joint=joints), method)
    assert apart.position[..., :2] == pytest.approx(flat.position[..., :2], abs=1e-11)
    assert apart.angular_velocity == pytest.approx(flat.angular_velocity, abs=1e-9)
    assert max(unbalanced(scene, apart)) < UNBALANCED, "reactions balance every body, out of the plane too"
    size = max(np.abs(wrench[:, 3:5]).max() for wrench in apart.reactions.values())
    assert size > 0.01, "joints carry moments out of the plane, N m, far above rounding"


@pytest.mark.parametrize("about", [(np.pi / 2, 0.0, 0.0), (0.0, np.pi / 2, 0.0), (0.4, 0.2, -0.3)])
def test_motion_turns_with_the_planes_of_a_mechanism(about):
    """Positions and accelerations turn by the vector (rad), to 1e-10 of the largest; bodies balance."""
    scene = find_scene("strandbeest[2]")
    q = rotations.from_vector(np.array(about))
    turned = in_another_frame(scene, q, np.zeros(3))
    here, there = run_of(scene), run_of(turned)
    for values, theirs in ((here.position, there.position), (here.acceleration, there.acceleration)):
        assert rotations.rotate(q, values) == pytest.approx(
            theirs, abs=1e-10 * np.abs(values).max()
        )  # measured: 3e-13
    assert max(unbalanced(turned, there)) < UNBALANCED


def test_two_hinges_in_place_of_one_carry_half_its_force_each():
    """The hinges are 0.2 m apart, symmetric to the plane of the links. The motion stays."""
    single, sides = find_scene("four_bar_chain[3]"), {"l": -0.1, "r": 0.1}
    each = [(joint, side) for joint in single.joint for side in sides]
    joints = [hinge(f"{j.name}{side}", *j.bodies, (*j.anchor[:2], sides[side])) for j, side in each]
    pairs = single.with_(joint=joints)
    one, two = run_of(single), run_of(pairs)
    assert two.position == pytest.approx(one.position, abs=1e-11)  # m
    assert max(unbalanced(pairs, two)) < UNBALANCED
    for name, wrench in one.reactions.items():
        left, right = (two.reactions[f"{name}{side}"][:, :3] for side in "lr")
        force = wrench[:, :3]
        assert left + right == pytest.approx(force, abs=1e-6)  # N
        # the share of redundant rows is determined up to the rounding unit times the penalty, 1e10
        assert left == pytest.approx(right, abs=1e-5 * np.abs(force).max())


@pytest.mark.parametrize("method", [METHOD, "taylor"])
def test_links_on_a_ball_joint_leave_their_planes_where_a_force_pushes(method):
    """A ball joint at the ground carries two links, which a hinge connects. A force of 3 N on one of them,
    normal to their planes, swings both out by more than 0.1 mm in 0.05 s, in which it would move a free link
    of 1 kg by 3.75 mm. Links that a hinge at the ground carries would stay in their planes to rounding."""
    bodies = [body(n, 1.0, [0.01, 0.1, 0.1], (0.5, 0.0, z)) for n, z in (("lower", 0.0), ("upper", 0.1))]
    joints = [joint("A", "spherical", "ground", "lower"), hinge("B", "lower", "upper", (1.0, 0.0, 0.05))]
    force = Force(body="upper", point=(0.5, 0.0, 0.1), force=(0.0, 0.0, 3.0))
    pushed = Scene(name="loose", gravity=(0.0, -9.81, 0.0), body=bodies, joint=joints, load=[force])
    out = run_of(pushed, method).position[-1, :, 2] - [0.0, 0.1]
    assert np.abs(out).min() > 1e-4


def crankshaft(singular: int, count: int) -> Scene:
    """Slider-cranks on one shaft; the rod of number ``singular`` is as long as its crank."""
    bodies, joints = [], []
    for i in range(count):
        rod = 0.304 if i == singular else 0.4048
        cylinder = slider_crank(0.304, rod, 0.3 + 2.0 * i, "c", 30.0, str(i), 0.1 * i)
        bodies += cylinder.body
        joints += cylinder.joint
        if i:
            joints.append(joint(f"E{i}", "fixed", f"crank{i - 1}", f"crank{i}", (0.0, 0.0, 0.1 * i - 0.1)))
    return Scene(name="crankshaft", gravity=(0.0, -9.81, 0.0), duration=0.1, body=bodies, joint=joints)


@pytest.mark.parametrize("singular", [0, 3])
def test_one_singular_loop_among_many_ends_the_run(singular):
    """Of five slider-cranks on a shaft at 30 rad/s one has a rod as long as its crank. The run ends in the
    first turn at its singular position: crank and rod are on one line across the slide, to 1e-3 rad."""
    scene = crankshaft(singular, 5)
    run = simulate(scene, METHOD, np.linspace(0.0, 0.1, 21))
    assert run.outcome.name == "SINGULAR_POSITION", run.message
    [met] = run.crossings
    k = scene.body_index(f"crank{singular}")
    reach = met.position[k, :2] / np.linalg.norm(met.position[k, :2])
    assert abs(reach[0]) < 1e-3, "the crank is across the slide, which is along x"
    assert 0.0 < run.t_end < 2 * np.pi / 30.0
