"""Loads of joints and loads over time: in both formulations of the reference, in engines and in MJCF."""

from pathlib import Path

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.features import FACTORS, feature_scenes
from crosscheck.engine import Owner, Setting, engine
from crosscheck.engines.mujoco.files import FORMAT
from crosscheck.engines.shared.spanning_tree import spanning_tree
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref.formats import ImportOptions
from mbref.motions.trajectory import Outcome
from mbref.scene import Factor, TorsionSpring
from mbref.scenes import SCENES
from tests.helpers import loads_over_time as scenes
from tests.helpers.loads_over_time import AXIS
from tests.helpers.measured import MARGIN, ROUNDING

TIMES = np.array([0.0, 0.3, 0.8, 0.9, 1.3, 1.45, 2.0])
FORMULATIONS = {"A": natural_motion, "B": lambda *args: tree_motion(*args, seconds=100.0)}
PROBES = feature_scenes()  # "joint_force load", ...: a body on a joint with this load and gravity
ROUNDED = 1e-15  # m: positions of up to 1 m, integrated in long double and rounded to double
MEASURED = {  # differences of positions (m), and of accelerations (of the largest), from the reference
    "mujoco": (ROUNDING, 4.7e-14),
    "exudyn": (1.7e-13, 2.6e-9),
    "pinocchio": (4.7e-13, 3.3e-12),
    "dart": (4.7e-13, 3.3e-12),
    "drake": (1e-11, 1e-9),
}


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize(
    ("scene", "displacement"),
    [(scenes.sprung_slide(), scenes.sprung_displacement), (scenes.thrown(), scenes.switched)],
    ids=["damped spring", "force switched on and off"],
)
def test_reference_formulations_displace_a_block_by_its_closed_form(formulation, scene, displacement):
    """A damped oscillator from rest, and a block whose acceleration is a cubic of time from 0.5 s to 1.5 s.
    They move up to 1 m, as the closed forms to 1e-15 m, rounding to doubles."""
    motion = FORMULATIONS[formulation](scene, TIMES, EXTENDED)
    assert not motion.reason
    moved = (doubles(motion.position[:, 0]) - scene.body[0].position) @ AXIS
    assert np.abs(moved - displacement(TIMES)).max() < ROUNDED


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_reference_formulations_turn_a_wheel_by_its_closed_form(formulation):
    """From rest φ'' = M A sin(ω t + p) / I, integrated twice, up to 1.2 rad; to 1e-15 rad, rounding."""
    motion = FORMULATIONS[formulation](scenes.wheel(), TIMES, EXTENDED)
    assert not motion.reason
    turned = 2 * np.arctan2(*doubles(motion.orientation)[:, 0, [3, 0]].T)
    assert np.abs(turned - scenes.turned(TIMES)).max() < ROUNDED


OF_JOINTS = ("slide_spring load", "joint_torque load", "joint_force load")
OVER_TIME = "polynomial loads over time"
CASES = [(of, name) for of in MEASURED for name in OF_JOINTS]
CASES += [("mujoco", f"{kind} loads over time") for kind in FACTORS]
CASES += [(of, OVER_TIME) for of in ("exudyn", "drake", "dart")]


@pytest.mark.parametrize(("of", "name"), CASES)
def test_engine_moves_loads_of_joints_and_over_time_as_the_reference(of, name):
    """The scene is a body on a joint with this load for 0.1 s. Loads over time have a polynomial, sine, table
    or switch as factor. Positions (m), and accelerations over the largest or over 1 m/s², differ from the
    reference by at most ten times MEASURED. Drake's and DART's accelerations are integrated by crosscheck."""
    pytest.importorskip({"drake": "pydrake", "dart": "dartpy"}.get(of, of))
    scene, times, simulator = PROBES[name].with_(duration=0.1), np.linspace(0.0, 0.1, 4), engine(of)
    run = simulator.run(scene, times, simulator.best_settings(scene)[-1])
    exact = natural_motion(scene, times, EXTENDED)
    assert run.outcome is Outcome.COMPLETED and not exact.reason, run.message
    place, change = (doubles(getattr(exact, field)) for field in ("position", "acceleration"))
    assert np.abs(run.position - place).max() < MARGIN * MEASURED[of][0]
    assert np.abs(run.acceleration - change).max() / max(np.abs(change).max(), 1.0) < MARGIN * MEASURED[of][1]


@pytest.mark.parametrize("name", (*OF_JOINTS, OVER_TIME))
@pytest.mark.parametrize(
    ("of", "module", "family", "options"),
    [
        ("drake", "pydrake", "discrete", {}),
        ("dart", "dartpy", "balls", {"erp": 0.5}),
        ("bullet", "pybullet", "iterated", {"iterations": 1000}),
    ],
)
def test_first_order_steps_with_joint_loads_converge_to_the_reference(of, module, family, options, name):
    """A tenth of the step leaves less than a fifth of the error, below a thousandth of the way moved (5.5e-4
    is measured). A lost or reversed load would leave about the way moved."""
    pytest.importorskip(module)
    scene, times = PROBES[name].with_(duration=0.2), np.array([0.0, 0.2])
    exact = doubles(natural_motion(scene, times, EXTENDED).position)
    moved = np.abs(exact[1] - exact[0]).max()
    settings = (Setting(family, {"step": h, **options}) for h in (1e-3, 1e-4))
    runs = (engine(of).run(scene, times, setting) for setting in settings)
    coarse, fine = (np.abs(run.position - exact).max() for run in runs)
    assert fine < 1e-3 * moved and fine < 0.2 * coarse, (coarse, fine, moved)


def test_hinge_with_a_load_keeps_its_coordinate_when_a_loop_is_cut():
    """Bennett's loop is cut at a hinge, which a closure "revolute" replaces, without a coordinate. With a
    spring on every hinge a body is cut ("weld"), and each hinge has its own coordinate."""
    scene = SCENES["bennett"]()
    springs = [TorsionSpring(joint=joint.name, stiffness=1.0) for joint in scene.joint]
    (whole,) = spanning_tree(scene, ("revolute",)).closures
    loaded = spanning_tree(scene.with_(load=springs), ("revolute",))
    assert whole.kind == "revolute" and [closure.kind for closure in loaded.closures] == ["weld"]
    assert len({loaded.coordinate(scene, spring.joint) for spring in springs}) == len(springs)


@pytest.mark.parametrize(("of", "kind"), [("pinocchio", "sine"), ("exudyn", "table"), ("exudyn", "switched")])
def test_adapter_refuses_a_function_of_time_that_it_does_not_map(of, kind):
    """Pinocchio's adapter maps none, Exudyn's only smooth ones. The refusal names the load."""
    refused = engine(of).cannot(PROBES[f"{kind} loads over time"])
    assert refused.owner is Owner.ADAPTER and "load[0]" in refused.reason
    assert engine("exudyn").cannot(PROBES["sine loads over time"]) is None


PLAIN = """<mujoco><option timestep="0.001" integrator="RK4"/><worldbody>
<body name="arm" pos="0.3 0 0"><inertial mass="1.5" pos="0 0 0" diaginertia="0.02 0.05 0.06"/>
<joint name="turn" type="hinge" axis="0 0 1" pos="-0.3 0 0" damping="0.1"/>
<body name="head" pos="0.4 0.1 0"><inertial mass="0.5" pos="0 0 0" diaginertia="0.01 0.02 0.03"/>
<joint name="slide" type="slide" axis="1 0.5 0" stiffness="40" damping="0.7" springref="0.05"/></body></body>
</worldbody><actuator><motor name="m" joint="turn" gear="20"/>
<general name="p" joint="slide" gainprm="3" gear="-2" ctrllimited="true" ctrlrange="-1 1"/>
</actuator><keyframe><key name="on" ctrl="0.05 4"/></keyframe></mujoco>"""


def read(tmp_path: Path, text: str, **options: object):
    (tmp_path / "model.xml").write_text(text)
    return FORMAT.read(tmp_path / "model.xml", ImportOptions(**options))


def test_joint_loads_return_from_exported_mjcf_with_their_motion(tmp_path):
    """A scene of an MJCF file is written to MJCF and read again. Motors are written with a keyframe "loads"
    of their controls, which the notes say. By the judge's reference both scenes move alike over 0.5 s to
    1e-13 m, rounding of the numbers in the file."""
    scene = read(tmp_path, PLAIN, keyframe="on").scene
    exported = FORMAT.write(scene)
    assert "its motor is controlled in keyframe 'loads'" in " ".join(exported.left_out)
    again = read(tmp_path, exported.text, keyframe="loads").scene
    kinds = sorted(load.type for load in scene.load)
    assert sorted(load.type for load in again.load) == kinds
    motions = [natural_motion(each, np.array([0.0, 0.5]), EXTENDED) for each in (scene, again)]
    assert np.abs(doubles(motions[0].position - motions[1].position)).max() < 100 * ROUNDED


def test_load_over_time_is_left_out_of_exported_mjcf_with_a_note(tmp_path):
    """The scene is that of an MJCF file, except that a motor's load is switched on at 0.2 s."""
    timed = read(tmp_path, PLAIN, keyframe="on").scene.with_("load[2].factor", Factor(start=0.2))
    assert "MJCF has no loads over time" in " ".join(FORMAT.write(timed).left_out)
