"""Corners of adapters / small models: frames of SDF files, a file's own settings, MuJoCo's linearisation and
its ports, worked out by hand."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest

from crosscheck.engine import Setting, engine
from crosscheck.engines.mujoco import original
from crosscheck.engines.mujoco.linearised import Linearised
from crosscheck.engines.mujoco.original import FINER, STIFFER, STIFFER_RK4
from crosscheck.engines.mujoco.ports import PortedModel
from crosscheck.engines.sampling import Failed
from crosscheck.engines.sdf.frames import ORIGIN, Frames, Pose, numbers, pose_of
from crosscheck.setting import AS_IN_FILE
from mbref.scene import Body, Revolute, Scene, SceneError
from mbref.trajectory import Outcome

Z = (0.0, 0.0, 1.0)
ROD = Body(name="rod", mass=2.0, inertia=(0.3, 0.3, 0.3), position=(0.7, 0.0, 0.0))
HINGE = Revolute(name="A", bodies=("ground", "rod"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))


# --- frames of SDF files ----------------------------------------------------------------------------------
def element(text: str) -> ET.Element:
    return ET.fromstring(f"<link>{text}</link>")


def test_numbers_of_an_element():
    assert numbers(None, "x", 3).tolist() == numbers(ET.fromstring("<a> </a>"), "x", 3).tolist() == [0.0] * 3
    assert numbers(ET.fromstring("<a> 1 2e0\n3 </a>"), "x", 3).tolist() == [1.0, 2.0, 3.0]
    for text in ("1 2", "1 2 3 4", "1 two 3", "1 nan 3", "1 inf 3"):
        with pytest.raises(SceneError, match=f"^x: must be 3 numbers, got '{text}'$"):
            numbers(ET.fromstring(f"<a> {text} </a>"), "x", 3)


def test_a_pose_turns_about_fixed_axes():
    """A roll of 90° brings y to z; then a yaw of 90° brings x to y; both bring z to x."""
    quarter = math.pi / 2
    found = pose_of(element(f"<pose>1 2 3 {quarter} 0 {quarter}</pose>"), "x")
    assert found.position.tolist() == [1.0, 2.0, 3.0]
    wanted = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    assert np.allclose(found.turn, wanted, atol=1e-15)
    pitched = pose_of(element(f"<pose>0 0 0 0 {quarter} 0</pose>"), "x")
    assert np.allclose(pitched.turn @ [1.0, 0.0, 0.0], [0.0, 0.0, -1.0])
    for yes in ("true", "True", "1"):
        by_degrees = pose_of(element(f'<pose degrees="{yes}">1 2 3 90 0 90</pose>'), "x")
        assert np.allclose(by_degrees.turn, wanted, atol=1e-15)
    assert not np.allclose(pose_of(element('<pose degrees="0">1 2 3 90 0 90</pose>'), "x").turn, wanted)
    half = math.sqrt(0.5)
    turned = pose_of(element(f'<pose rotation_format="quat_xyzw">1 2 3 {half} 0 0 {half}</pose>'), "x")
    assert np.allclose(turned.turn, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15)
    assert turned.position.tolist() == [1.0, 2.0, 3.0] and pose_of(element(""), "x") is ORIGIN
    for scale, is_refused in ((1.0 + 0.9e-6, False), (1.0 + 1.1e-6, True)):
        long = element(f'<pose rotation_format="quat_xyzw">0 0 0 0 0 0 {scale!r}</pose>')
        if is_refused:
            with pytest.raises(SceneError, match=r"^x: the quaternion must have length one, got 1$"):
                pose_of(long, "x")
        else:
            assert np.array_equal(pose_of(long, "x").turn, np.eye(3))


MODEL = """
<model>
  <link name="base"><pose relative_to="world">1 0 0 0 0 1.5707963267948966</pose></link>
  <link name="tip"><pose relative_to="hand">0 1 0 0 0 0</pose></link>
  <frame name="hand" attached_to="base"><pose relative_to="base">2 0 0 0 0 0</pose></frame>
  <frame name="loose"/>
  <frame name="round" attached_to="about"/><frame name="about" attached_to="round"/>
  <frame name="circle"><pose relative_to="ring">0 0 0 0 0 0</pose></frame>
  <frame name="ring"><pose relative_to="circle">0 0 0 0 0 0</pose></frame>
  <joint name="A"><child> tip </child></joint>
</model>"""


def test_frames_in_frames():
    """The base is turned by 90° at x = 1: 2 m along its x end at y = 2, and 1 m along its y at x = -1."""
    frames = Frames(ET.fromstring(MODEL))
    assert np.allclose(frames.world("hand").position, [1.0, 2.0, 0.0])
    assert np.allclose(frames.world("tip").position, [0.0, 2.0, 0.0])
    assert np.allclose(frames.world("tip").turn, [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert frames.has("hand") and frames.has("A") and not frames.has("world")
    assert frames.world("loose").position.tolist() == [0.0] * 3
    assert [frames.link_of(name) for name in ("hand", "A", "tip", "world")] == ["base", "tip", "tip", "world"]
    with pytest.raises(SceneError, match=r"^frame 'none': the model has no link, joint or frame"):
        frames.world("none")
    with pytest.raises(SceneError, match=r"is given relative to itself, by circle → ring → circle$"):
        frames.world("circle")
    for name in ("round", "none"):
        with pytest.raises(SceneError, match=r"is attached to no link of the model$"):
            frames.link_of(name)
    inner = Pose(np.array([0.0, 1.0, 0.0]), np.diag([-1.0, -1.0, 1.0]))
    assert frames.world("base").then(inner).position == pytest.approx([0.0, 0.0, 0.0], abs=1e-15)


# --- a file at its own settings ---------------------------------------------------------------------------
PENDULUM = """
<mujoco>
  <option timestep="0.25" gravity="0 0 0" solver="CG" iterations="7"/>
  <worldbody><body name="rod"><joint name="A" axis="0 1 0"/>
    <geom type="sphere" size="0.1" mass="2" pos="1 0 0"/></body></worldbody>
</mujoco>"""


@pytest.fixture
def file(tmp_path) -> Path:
    (tmp_path / "rod.xml").write_text(PENDULUM)
    return tmp_path / "rod.xml"


def opened(file: Path, family: str = AS_IN_FILE, **options: object) -> original._Original:
    return original._Original(mujoco, Setting(family, {"file": str(file), **options}))


def test_own_lines_of_a_setting():
    assert original.own_code(Setting(AS_IN_FILE, {"step": 0.1})) == ""
    assert original.own_code(Setting("stock", {"step": 0.1})) == ""
    assert original.own_code(Setting(FINER, {"step": 0.1})) == '<option timestep="0.1"/>'
    closures = (
        f'<default><equality solref="0.2 1" solimp="{" ".join(map(repr, original.STIFFEST))}"/></default>'
    )
    assert original.own_code(Setting(STIFFER, {"step": 0.1})) == f'<option timestep="0.1"/>{closures}'
    rk4 = f'<option timestep="0.1" integrator="RK4"/>{closures}'
    assert original.own_code(Setting(STIFFER_RK4, {"step": 0.1})) == rk4


def test_settings_of_a_file_and_changed_ones(file):
    own = opened(file)
    assert own.settings == {
        "step": 0.25,
        "integrator": "Euler",
        "solver": "CG",
        "iterations": 7,
        "file": str(file),
    }
    changed = opened(file, step=0.125, integrator="implicitfast", solver="Newton", iterations=3)
    found = original.own_settings(changed.model)
    assert found == {"step": 0.125, "integrator": "implicitfast", "solver": "Newton", "iterations": 3}
    assert changed.step == 0.125
    kinds = mujoco.mjtIntegrator
    assert opened(file, STIFFER).model.opt.integrator == kinds.mjINT_EULER
    assert opened(file, STIFFER_RK4).model.opt.integrator == kinds.mjINT_RK4
    with pytest.raises(ValueError, match=r"^option solver: 'X' is none of PGS, CG, Newton$"):
        opened(file, solver="X")
    with pytest.raises(ValueError, match=r"^settings of the family 'as in file' need the option 'file'$"):
        original.run(Scene(name="s", body=(ROD,)), np.zeros(1), Setting(AS_IN_FILE, {}), "1")


def test_steps_between_samples_are_counted(file):
    """Steps of 0.25 s: three to 0.75 s, and one shorter step on a copy for a sample at 0.9 s."""
    run = opened(file)
    run.data.qvel[:] = 2.0
    run.advance(0.0, 0.75)
    assert (run.counts.steps, run.counts.rhs, run.data.time) == (3, 3, 0.75)
    run.advance(0.75, 0.9)
    assert (run.counts.steps, run.data.time) == (4, 0.75) and run.model.opt.timestep == 0.25
    assert run.between.time == pytest.approx(0.9) and run.between.qpos[0] == pytest.approx(1.8)
    run.advance(0.9, 1.25)
    assert run.counts.steps == 6 and run.between.qpos[0] == pytest.approx(2.5), "not from the copy"
    fourth = opened(file, STIFFER_RK4)
    fourth.advance(0.0, 0.5)
    assert (fourth.counts.steps, fourth.counts.rhs) == (2, 8)
    run.data.qvel[:] = np.nan
    with pytest.raises(
        Failed, match=r"^the state became infinite or NaN between 1\.25 s and 1\.5 s$"
    ) as failed:
        run.advance(1.25, 1.5)
    assert failed.value.outcome is Outcome.NOT_FINITE


# --- small motions and ports ------------------------------------------------------------------------------
def pendulum(**changes: object) -> Scene:
    """A rod that hangs below a hinge, 0.7 m away: ω² = 13.734 / 1.28."""
    hanging = ROD.model_copy(update={"position": (0.0, 0.0, -0.7)})
    return Scene(
        name="rod", gravity=(0.0, 0.0, -9.81), duration=1.0, body=(hanging,), joint=(HINGE,), **changes
    )


def test_eigenvalues_of_a_pendulum_by_mujoco():
    first, second = sorted(Linearised().own_eigenvalues(pendulum()), key=lambda s: s.imag)
    rate = math.sqrt(13.734 / 1.28)
    assert second.imag == pytest.approx(rate, rel=1e-6) == -first.imag
    assert abs(second.real) < 1e-3 * rate and Linearised.linearises_by == "mjd_transitionFD"


def test_a_ported_model_moves_its_links():
    """At 90° the rod points along -x; at 3 rad/s about y its centre moves along z."""
    ported = PortedModel(pendulum(), Setting("stock", {"step": 0.01}))
    motion = ported.motion([math.pi / 2], [3.0])
    assert motion.angular_velocity.tolist() == [[0.0, 3.0, 0.0]]
    assert motion.rotation.shape == (1, 3, 3) and np.allclose(motion.rotation[0] @ Z, [1.0, 0.0, 0.0])
    lever = motion.rotation[0] @ np.array([0.0, 0.0, -0.7])
    assert np.allclose(
        motion.velocity[0] + np.cross([0.0, 3.0, 0.0], lever - motion.position[0]), [0, 0, 2.1]
    )
    assert motion.coordinates.tolist() == [math.pi / 2] and motion.rates.tolist() == [3.0]
    model = ported.model
    assert model.opt.timestep == 0.01 and model.opt.jacobian == mujoco.mjtJacobian.mjJAC_DENSE
    integrators = {
        f: PortedModel(pendulum(), Setting(f, {"step": 0.01})).model for f in ("defaults", "euler")
    }
    kinds = mujoco.mjtIntegrator
    assert model.opt.integrator == kinds.mjINT_RK4
    assert {m.opt.integrator for m in integrators.values()} == {int(kinds.mjINT_EULER)}


def test_settings_of_ports_are_coarse_to_fine():
    found = engine("mjx").settings(pendulum())
    steps = {f: [s.options["step"] for s in found if s.family == f] for f in ("defaults", "stock")}
    assert all(of == sorted(of, reverse=True) for of in steps.values())
    assert {*steps["defaults"]} - {*steps["stock"]} <= {0.002} and 0.002 in steps["defaults"]
