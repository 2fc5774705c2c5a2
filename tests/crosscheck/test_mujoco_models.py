"""A scene as a model of MuJoCo, and one simulation of it / numbers worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines.mujoco import model as built
from crosscheck.engines.mujoco.model import compiled
from crosscheck.engines.mujoco.simulation import Simulation
from mbref.scene import (
    Body,
    Coupling,
    Fixed,
    Force,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    Spring,
    TorsionSpring,
    Translational,
)

BODY = Body(name="b", mass=4.0, inertia=(1.0, 2.0, 2.5), position=(1.0, 0.0, 0.0))
HINGE = Revolute(name="H", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))
SLIDE = Translational(name="S", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 3.0, 0.0))
RISING = {"polynomial": (1.0, 2.0)}  # 1 + 2 t


def scene(**parts: Any) -> Scene:
    given = {"name": "s", "body": (BODY,), "joint": (HINGE,), "duration": 2.0, "gravity": (0.0, 0.0, 0.0)}
    return Scene(**{**given, **parts})


def simulation(family: str = "defaults", given: Scene | None = None, **options: Any) -> Simulation:
    return Simulation(given or scene(), Setting(family, options))


# --- Bodies and joints ------------------------------------------------------------------------------------
def test_hinge_becomes_mujoco_s_hinge_with_anchor_axis_and_inertia() -> None:
    """About the hinge the body has 2.5 kg m² + 4 kg · (1 m)²."""
    model = compiled(scene(gravity=(1.0, 2.0, 3.0))).model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert model.jnt_type.tolist() == [int(mujoco.mjtJoint.mjJNT_HINGE)]
    assert data.xanchor.tolist() == [[0.0, 0.0, 0.0]] and data.xaxis.tolist() == [[0.0, 0.0, 1.0]]
    assert data.xpos[1].tolist() == [1.0, 0.0, 0.0] and data.M.tolist() == pytest.approx([2.5 + 4.0])
    assert model.opt.gravity.tolist() == [1.0, 2.0, 3.0]


def test_compiled_model_has_the_scene_s_mass_and_full_inertia() -> None:
    """The inertia's eigenvectors lie along no axis; the body is turned by half a turn about x. With 4 kg at
    1 m from the hinge and I_z = 4 kg m², the hinge has 8 kg m²."""
    inertia = ((2.0, 0.5, 0.0), (0.5, 3.0, 0.25), (0.0, 0.25, 4.0))
    turned = BODY.model_copy(update={"inertia": inertia, "orientation": (0.0, 1.0, 0.0, 0.0)})
    model = compiled(scene(body=(turned,))).model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    axes = data.ximat[1].reshape(3, 3)
    half_turn = np.diag([1.0, -1.0, -1.0])
    assert axes @ np.diag(model.body_inertia[1]) @ axes.T == pytest.approx(half_turn @ inertia @ half_turn)
    assert np.linalg.det(axes) == pytest.approx(1.0) and model.body_mass.tolist() == [0.0, 4.0]
    assert data.xipos[1].tolist() == [1.0, 0.0, 0.0] and model.body_subtreemass[0] == 4.0
    assert model.dof_M0.tolist() == pytest.approx([4.0 + 4.0])


def test_armature_and_coupling_become_mujoco_s_armature_and_joint_equality() -> None:
    """The coupling S = 3 H is an equality of joint coordinates with the polynomial 0 + 3 H."""
    geared = HINGE.model_copy(update={"armature": 0.75})
    other = BODY.model_copy(update={"name": "c"})
    slide = SLIDE.model_copy(update={"bodies": ("ground", "c")})
    coupling = Coupling(name="K", joints=("H", "S"), ratio=3.0)
    model = compiled(scene(body=(BODY, other), joint=(geared, slide), coupling=(coupling,))).model
    assert model.dof_armature.tolist() == [0.75, 0.0] and model.neq == 1
    assert model.equality(0).name == built.COUPLING + "K"
    assert (model.eq_obj1id.tolist(), model.eq_obj2id.tolist()) == ([1], [0])
    assert model.eq_data[0, :5].tolist() == [0.0, 3.0, 0.0, 0.0, 0.0]
    assert model.eq_type.tolist() == [int(mujoco.mjtEq.mjEQ_JOINT)]


# --- Loads ------------------------------------------------------------------------------------------------
def test_a_force_acts_at_its_point_and_a_moment_on_the_body() -> None:
    """A force of 6 N along y at x = 3 m turns the hinge with 18 N m, the moment with 5 N m."""
    force = Force(body="b", point=(3.0, 0.0, 0.0), force=(0.0, 6.0, 0.0))
    moment = Moment(body="b", moment=(1.0, 2.0, 5.0))
    found = compiled(scene(load=(force, moment)))
    model, data = found.model, mujoco.MjData(found.model)
    found.apply(data, 0.0)
    mujoco.mj_forward(model, data)
    assert data.qacc == pytest.approx([23.0 / 6.5])
    assert found.applied[model.body("force 0").id].tolist() == [0.0, 6.0, 0.0, 0.0, 0.0, 0.0]
    assert found.applied[1].tolist() == [0.0, 0.0, 0.0, 1.0, 2.0, 5.0]
    assert model.body_mass[model.body("force 0").id] == 0.0
    assert data.xpos[model.body("force 0").id].tolist() == [3.0, 0.0, 0.0]


def test_loads_over_time_are_added_at_the_time_of_the_data() -> None:
    """At 1.5 s the factor 1 + 2 t is 4: a force of 24 N, torques of 4 · 7 + 0.5 N m; a second call adds
    nothing. Loads without a factor stay."""
    force = Force(body="b", point=(3.0, 0.0, 0.0), force=(0.0, 6.0, 0.0), factor=RISING)
    torque = JointTorque(joint="H", torque=7.0, factor=RISING)
    steady = JointTorque(joint="H", torque=0.5)
    still = Moment(body="b", moment=(1.0, 0.0, 0.0))
    found = compiled(scene(load=(force, torque, steady, still)))
    data = mujoco.MjData(found.model)
    for _ in range(2):
        data.time = 1.5
        found.apply(data, 0.0)
        place = found.model.body("force 0").id
        assert data.xfrc_applied[place].tolist() == [0.0, 24.0, 0.0, 0.0, 0.0, 0.0]
        assert data.xfrc_applied[1].tolist() == [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]
        assert data.qfrc_applied.tolist() == [28.5]


def test_torsion_springs_of_a_hinge_are_added_to_one() -> None:
    """2 N m/rad at 0.1 rad and 6 at 0.5 rad are 8 N m/rad at (0.2 + 3) / 8 = 0.4 rad; dampings add up."""
    loads = (
        TorsionSpring(joint="H", stiffness=2.0, damping=0.25, natural_angle=0.1),
        TorsionSpring(joint="H", stiffness=0.0, damping=1.0, natural_angle=9.0),
        TorsionSpring(joint="H", stiffness=6.0, damping=0.5, natural_angle=0.5),
    )
    model = compiled(scene(load=loads)).model
    assert model.jnt_stiffness.tolist() == [8.0] and model.dof_damping.tolist() == [1.75]
    assert model.qpos_spring.tolist() == pytest.approx([0.4])


def test_spring_becomes_a_tendon_between_its_two_points() -> None:
    """From (1, 0, 2) to (1, 0, 0.5): its length is 1.5 m, its natural length 0.25 m."""
    spring = Spring(
        bodies=("ground", "b"),
        points=((1.0, 0.0, 2.0), (1.0, 0.0, 0.5)),
        natural_length=0.25,
        stiffness=8.0,
        damping=0.75,
    )
    model = compiled(scene(load=(spring,))).model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ten_length.tolist() == [1.5] and model.tendon_lengthspring.tolist() == [[0.25, 0.25]]
    assert model.tendon_stiffness.tolist() == [8.0] and model.tendon_damping.tolist() == [0.75]
    assert [data.site(f"spring 0.{i}").xpos.tolist() for i in range(2)] == [[1, 0, 2], [1, 0, 0.5]]


# --- One run ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("family", "rhs"), [("stock", 4), ("euler", 1)])
def test_fixed_steps_fill_the_interval_and_are_counted(family: str, rhs: int) -> None:
    """Steps of at most 0.15 s: 4 in 0.5 s, 2 more to 0.75 s; RK4 evaluates 4 times a step, Euler once.
    A torque of 6.5 N m accelerates the hinge's 6.5 kg m² by 1 rad/s²."""
    found = simulation(family, scene(load=(JointTorque(joint="H", torque=6.5),)), step=0.15)
    found.advance(0.0, 0.5)
    assert (found.counts.steps, found.counts.rhs) == (4, 4 * rhs) and found.data.time == 0.5
    assert found.data.qvel == pytest.approx([0.5])
    found.advance(0.5, 0.75)
    assert found.counts.steps == 6 and found.data.qvel == pytest.approx([0.75])


def test_steps_end_where_a_load_over_time_stops() -> None:
    """1 rad/s² until 0.25 s, then nothing: 0.25 rad/s, and 0.25² / 2 + 0.25 · 0.75 rad at 1 s. Steps of at
    most 0.5 s: one to 0.25 s, two to 1 s."""
    torque = JointTorque(joint="H", torque=6.5, factor={"stop": 0.25})
    found = simulation("stock", scene(load=(torque,)), step=0.5)
    with found.installed():
        found.advance(0.0, 1.0)
    assert found.data.qvel == pytest.approx([0.25]) and found.data.qpos == pytest.approx([0.03125 + 0.1875])
    assert found.counts.steps == 3 and found.since == 1.0


def test_a_sample_has_poses_velocities_and_reactions_in_world_axes() -> None:
    """After a quarter turn the body is at (0, 1, 0) m, with 3 rad/s about z: v = (-3, 0, 0) m/s and
    a = (0, -9, 0) m/s². Hinge force: m (a - g) = 4 kg · (0, -9, 2) m/s²."""
    turned = BODY.model_copy(
        update={
            "orientation": (0.0, 1.0, 0.0, 0.0),
            "velocity": (0.0, 3.0, 0.0),
            "angular_velocity": (0, 0, 3.0),
        }
    )
    found = simulation("tuned", scene(body=(turned,), gravity=(0.0, 0.0, -2.0)))
    found.data.qpos[0] = math.pi / 2
    sample = found.sample(0.25)
    half = math.sqrt(0.5)
    assert found.since == 0.25 and sample.position == pytest.approx(np.array([[0.0, 1.0, 0.0]]), abs=1e-15)
    assert sample.orientation == pytest.approx(np.array([[0.0, half, half, 0.0]]), abs=1e-15)
    assert sample.velocity == pytest.approx(np.array([[-3.0, 0.0, 0.0]]), abs=1e-15)
    assert sample.angular_velocity == pytest.approx(np.array([[0.0, 0.0, 3.0]]))
    assert sample.acceleration == pytest.approx(np.array([[0.0, -9.0, 0.0]]), abs=1e-12)
    assert sample.angular_acceleration == pytest.approx(np.zeros((1, 3)), abs=1e-12)
    force = sample.reactions["H"][:3]
    assert force == pytest.approx([0.0, -36.0, 8.0], abs=1e-12)


def test_reactions_of_a_body_held_twice_balance_its_force() -> None:
    """A hinge and a weld hold a body against a force of 10 N: their forces add up to -10 N."""
    fixed = Fixed(name="F", bodies=("ground", "b"), anchor=(1.0, 0.0, 0.0))
    pull = Force(body="b", point=(1.0, 0.0, 0.0), force=(0.0, 10.0, 0.0))
    found = simulation("tuned", scene(joint=(HINGE, fixed), load=(pull,)), beta=1.0)
    found.link_motion()
    wrenches = found.closing()
    assert len(wrenches) == len(found.compiled.tree.closures) == 1
    reactions = found.sample(0.0).reactions
    total = sum(np.array(reactions[name][:3]) for name in ("H", "F"))
    assert total == pytest.approx([0.0, -10.0, 0.0], abs=1e-5)
