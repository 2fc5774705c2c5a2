"""OndselSolver against truths and Pinocchio, and scenes that it does not move."""

import math
from functools import partial

import numpy as np
import pytest

from crosscheck.engine import Owner, Setting, engine
from crosscheck.judge.constraints import joint_coordinates
from crosscheck.judge.metrics import violation_series
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Distance, Driver, Moment, Scene, Sine
from mbref.scenes import SCENES
from tests.helpers import parts, tree_scenes
from tests.helpers.measured import MARGIN, ROUNDING, completed_error

pytest.importorskip("pyondsel", reason="the optional engine OndselSolver needs pyondsel")

body = partial(tree_scenes.body, mass=1.5)


def simulate(scene: Scene, times: np.ndarray, step: float) -> Trajectory:
    return engine("ondsel").run(scene, times, Setting("kinematics", {"step": step}))


def test_uneven_sample_times_leave_the_error_at_rounding() -> None:
    """OndselSolver takes even spacings only: the adapter starts a new analysis at each change of spacing. The
    error from the four-bar's closed form is at most 1e-13 m or rad."""
    scene = SCENES["four_bar"]()
    times = np.array([0.003, 0.004, 0.011, 0.02, 0.03, 0.057, 0.0999])
    run = simulate(scene, times, 5e-4)
    assert np.array_equal(run.times, times) and completed_error(run, scene) < MARGIN * ROUNDING


def clockwork(swapped: bool) -> Scene:
    """Six joint kinds, driven in full: a crank with a lump, a rod to a sled, a piston turned on its stem."""

    def link(name: str, kind: str, first: str, second: str, at: tuple, **fields: object) -> dict:
        return parts.joint(name, kind, *((second, first) if swapped else (first, second)), at, **fields)

    turn = -1 if swapped else 1
    rod_axes, link_axes = ((0.0, 0.0, 1.0), (0.3, -1.0, 0.0)), ((0.0, 1.0, 0.0), (1.0, 0.0, -0.5))
    bodies = (
        body("crank", (0.15, 0.02, 0.1), (0.3, 0.1, 0.9)),
        body("lump", (0.1, -0.2, 0.3), (0.5, 0.6, 0.7)),
        body("rod", (0.6, 0.1, 0.1), (0.1, 0.5, -0.2)),
        body("sled", (1.0, 0.15, 0.2), (-0.4, 0.2, 0.1)),
        body("piston", (-0.5, 0.6, 0.4), (0.2, 0.2, 0.2)),
        body("link", (0.0, 0.7, 0.6), (0.4, -0.2, 0.1)),
    )
    joints = (
        link("rev", "revolute", "ground", "crank", (0.0, 0.0, 0.0), axis=(0.1, 0.0, 2.0)),
        link("fix", "fixed", "crank", "lump", (0.1, 0.0, 0.1)),
        link("uni", "universal", "crank", "rod", (0.3, 0.05, 0.1), axes=rod_axes[::turn]),
        link("sph", "spherical", "rod", "sled", (0.9, 0.1, 0.1)),
        link("tra", "translational", "ground", "sled", (1.0, 0.1, 0.2), axis=(1.0, 0.2, 0.1)),
        link("cyl", "cylindrical", "ground", "piston", (-0.5, 0.5, 0.4), axis=(0.0, 1.0, 0.2)),
        link("pin", "universal", "piston", "link", (-0.4, 0.7, 0.5), axes=link_axes[::turn]),
        link("end", "spherical", "link", "ground", (0.4, 0.8, 0.7)),
    )
    wave = Driver(joint="cyl", polynomial=(0.0, -1.0), sine=Sine(amplitude=0.3, frequency=5.0))
    drivers = (Driver(joint="rev", polynomial=(0.0, 3.0, 4.0)), wave)
    made = {"body": bodies, "joint": joints, "driver": drivers}
    return Scene(name="clockwork", gravity=(0.5, -9.81, 2.0), duration=0.3, **made)


@pytest.mark.parametrize("swapped", [False, True])
def test_ondsel_moves_six_joint_types_as_pinocchio(swapped: bool) -> None:
    """Poses, rates, accelerations and reactions of a driven mechanism with full inertia matrices, in either
    order of the joints' bodies; Pinocchio computes them by another method. At most ten times the measured
    differences are allowed: 5.2e-14 rad; 3.9e-14 and, of reactions, 1.9e-13 of the largest."""
    pytest.importorskip("pinocchio")
    scene = clockwork(swapped)
    times = np.linspace(0, scene.duration, 6)
    run = simulate(scene, times, 5e-3)
    other = engine("pinocchio").run(scene, times, Setting("tuned", {"rtol": 1e-11, "min_step": 1e-4}))
    assert run.outcome is other.outcome is Outcome.COMPLETED, (run.message, other.message)
    assert rotations.angle_between(run.orientation, other.orientation).max() < MARGIN * 5.2e-14
    for field in ("position", "velocity", "angular_velocity", "acceleration", "angular_acceleration"):
        ours, theirs = getattr(run, field), getattr(other, field)
        apart = abs(ours - theirs).max() / abs(theirs).max()
        assert apart < MARGIN * 3.9e-14, f"{field}: relative difference {apart:.1e}"
    for joint, wrench in other.reactions.items():
        apart = abs(run.reactions[joint] - wrench).max() / abs(wrench).max()
        assert apart < MARGIN * 1.9e-13, f"reaction in {joint}: relative difference {apart:.1e}"


@pytest.mark.parametrize("swapped", [False, True])
def test_driver_with_a_phase_turns_the_joint_as_prescribed(swapped: bool) -> None:
    """φ = 0.3 sin(5 t + 0.4) - t - 0.3 sin 0.4 (rad), to 1e-13 rad of rounding, also if every joint has its
    two bodies swapped. Two spacings of samples, so that the second analysis begins within the motion."""
    sine = Sine(amplitude=0.3, frequency=5.0, phase=0.4)
    start = -sine.amplitude * math.sin(sine.phase)
    base = clockwork(swapped)
    scene = base.with_(driver=(base.driver[0], Driver(joint="cyl", polynomial=(start, -1.0), sine=sine)))
    run = simulate(scene, np.array([0.0, 0.1, 0.2, 0.25, 0.3]), 5e-3)
    assert run.outcome is Outcome.COMPLETED, run.message
    found = joint_coordinates(scene, run.times, run.position, run.orientation, run.angular_velocity)["cyl"]
    prescribed = start - run.times + sine.amplitude * np.sin(5.0 * run.times + 0.4)
    assert abs(found[:, 0] - prescribed).max() < MARGIN * ROUNDING


CORD = Distance(name="cord", bodies=("crank", "sled"), anchors=((0.3, 0.0, 0.0), (1.0, 0.1, 0.2)))


@pytest.mark.parametrize(
    ("scene", "says"),
    [
        (clockwork(False).with_(joint=(*clockwork(False).joint, CORD)), "distance"),
        (SCENES["planar_slider_crank"](), "drivers do not prescribe the whole motion"),
        (SCENES["four_bar_straight"](), "drivers do not prescribe the whole motion"),
    ],
    ids=["distance joint", "no driver", "driven from a position with two branches"],
)
def test_ondsel_refuses_what_the_library_cannot_move(scene: Scene, says: str) -> None:
    """The refusal has a word of the library's own limit; Owner.ENGINE is the library, not the adapter."""
    refusal = engine("ondsel").cannot(scene)
    assert refusal is not None and refusal.owner is Owner.ENGINE and says in refusal.reason, refusal


def test_ondsel_gives_reactions_only_with_masses_and_without_loads() -> None:
    """Reactions of a driven mechanism without masses are undetermined, and OndselSolver receives no loads.
    The drivers determine its motion, which is the same in all three cases."""
    base = SCENES["spatial_slider_crank_driven"]()
    bare = base.with_(body=tuple(b.model_copy(update={"mass": None, "inertia": None}) for b in base.body))
    loaded = base.with_(load=(Moment(body="crank", moment=(0.0, 1.0, 0.0)),))
    runs = {scene: simulate(scene, np.array([0.01]), 1e-3) for scene in (base, bare, loaded)}
    assert runs[base].reactions is not None, "no reactions of a scene without loads"
    assert runs[bare].reactions is None and runs[loaded].reactions is None, "reactions of unknown forces"
    assert max(abs(run.position - runs[base].position).max() for run in runs.values()) < MARGIN * ROUNDING


def test_driver_beyond_the_reach_ends_the_run_with_the_samples_before_the_failure() -> None:
    """The slider starts at the end of its reach. At 0.01 s, 5 mm beyond it, OndselSolver tilts the crank of
    0.1 m by 0.05 rad, which the judge measures as a violation of the crank's hinge, and then fails."""
    base = SCENES["spatial_slider_crank"]()
    scene = base.with_(driver=(Driver(joint="D", polynomial=(0.0, 0.0, 50.0)),), load=())
    run = simulate(scene, np.linspace(0, 0.2, 21), 2e-3)
    assert run.outcome is Outcome.NOT_CONVERGED and "OndselSolver failed" in run.message, run.message
    assert len(run.times) == 2 and violation_series(scene, run)[1] == pytest.approx(0.05, rel=0.01)
