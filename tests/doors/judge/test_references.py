"""References of short motions: stored states, closed forms, and invariance under units, frames and order."""

import re

import numpy as np
import pytest

from crosscheck import truth_for
from crosscheck.cli import main
from crosscheck.judge import constraints
from crosscheck.judge.joint_reactions import shared_wrenches
from crosscheck.judge.reference.isostatic import isostatic, replaced
from crosscheck.judge.reference.reference import Reference, reference
from crosscheck.judge.truth import closed_form
from mbref.motions.trajectory import Trajectory
from mbref.scene import Driver, Scene
from tests.helpers.changed_scenes import in_other_units
from tests.helpers.errors import pose_error, rate_error, turned_between
from tests.helpers.exact_motions import stored
from tests.helpers.loads_over_time import wheel
from tests.helpers.short_motions import CROSSED, MOTIONS, times_of

ROUNDING = 2.2e-16
LIMIT = 60.0  # CPU s of a reference; each takes about 0.2

EXPENSIVE = {  # more than 0.8 CPU s each
    *("flyball_governor", "spatial_slider_crank", "planar_slider_crank", "planar_slider_crank_equal"),
    *("five_bar_gravity", "five hinges", "two loops on one crank"),
}


def a_few(names: list[str], step: int, first: int = 0) -> list[object]:
    """Return the names as cases: each one of ``step`` for the gate, the rest for the slow suite."""
    return [
        name
        if k % step == first % step and name not in EXPENSIVE
        else pytest.param(name, marks=pytest.mark.slow)
        for k, name in enumerate(names)
    ]


SMOOTH = [name for name in MOTIONS if name not in CROSSED]


@pytest.fixture(autouse=True)
def _no_motion_is_known(tmp_path, monkeypatch):
    """References are computed anew, and none is read from the user's cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def motion_of(scene: Scene, times: np.ndarray | None = None) -> Trajectory:
    """Return the judge's motion of a scene at the times of a short motion, or at others."""
    truth = truth_for(scene, reference_time=LIMIT)
    assert truth is not None
    return truth.poses(times_of(scene) if times is None else times)


def referred(scene: Scene, times: np.ndarray) -> Reference:
    """Return the reference of a scene at times, also where a closed form is known."""
    found = reference(scene, times, LIMIT)
    assert isinstance(found, Reference), found
    return found


@pytest.mark.parametrize("name", a_few(list(MOTIONS), 9))
def test_judge_computes_the_stored_states_again_within_their_bound(name):
    """The stored bound, at least 20 roundings, is of poses; rates have ten times as much."""
    scene, exact = MOTIONS[name](), stored()[name]
    found = motion_of(scene)
    bound = max(exact["bound"], 20 * ROUNDING)
    assert pose_error(found, exact) <= bound
    assert rate_error(found, exact) <= 10 * bound


CLOSED = [name for name in MOTIONS if closed_form(MOTIONS[name]()) is not None]


@pytest.mark.parametrize("name", a_few([name for name in MOTIONS if name not in CLOSED], 9))
def test_both_formulations_of_a_reference_confirm_each_other_at_every_sample(name):
    """Natural coordinates and a tree of joints share no equations; ``both`` is True where they agree."""
    scene = MOTIONS[name]()
    assert referred(scene, times_of(scene)).both.all()


@pytest.mark.parametrize("name", a_few(SMOOTH, 25, 3))
def test_states_of_a_reference_do_not_depend_on_other_samples(name):
    """Asked for six more times, the judge has the stored states, to the sum of both bounds."""
    scene = MOTIONS[name]()
    times = np.union1d(times_of(scene), scene.duration * np.array([0.05, 0.11, 0.5, 0.52, 0.9, 0.99]))
    found = motion_of(scene, times)
    chosen = np.isin(times, times_of(scene))
    exact = stored()[name]
    bound = 2 * max(exact["bound"], 20 * ROUNDING)  # both states have one
    assert np.abs(found.position[chosen] - exact["position"]).max() <= 2 * bound  # m, at up to 2 m
    assert turned_between(found.orientation[chosen], np.array(exact["orientation"])).max() <= bound


@pytest.mark.parametrize("size", [1e-4, 1e4])
@pytest.mark.parametrize("name", ["four hinges", "doubled hinge", "slider-crank of hinges"])
def test_number_of_undetermined_reactions_of_each_joint_does_not_depend_on_the_size(name, size):
    """Redundant joints share reactions in undetermined parts; directions of axes give their number."""
    plain = MOTIONS[name]()
    scene = in_other_units(plain, 1.0, size, 1.0)
    shared, wanted = (shared_wrenches(s, 0.0, *constraints.initial_poses(s)) for s in (scene, plain))
    assert {n: b.shape[1] for n, b in shared.items()} == {n: b.shape[1] for n, b in wanted.items()}
    assert sum(basis.shape[1] for basis in wanted.values()) > 0


@pytest.mark.parametrize("size", [1e-4, 1e4])
@pytest.mark.parametrize("name", ["four hinges", "doubled hinge", "slider-crank of hinges"])
def test_weaker_joints_that_leave_no_row_redundant_do_not_depend_on_the_size(name, size):
    """The isostatic scene replaces joints with redundant rows by weaker ones; lengths do not matter to it."""
    plain = MOTIONS[name]()
    scene = in_other_units(plain, 1.0, size, 1.0)
    weaker = replaced(plain, isostatic(plain))
    assert weaker and replaced(scene, isostatic(scene)) == weaker


@pytest.mark.parametrize(
    ("amplitude", "status", "unknown", "end"),
    [
        pytest.param(0.6, 0, [], 0.0, id="less than a turn"),
        pytest.param(30.0, 1, ["unknown: J.angle"], np.nan, id="ten turns", marks=pytest.mark.slow),
    ],
)
def test_angle_not_sampled_for_400_s_is_exact_or_unknown(amplitude, status, unknown, end, tmp_path, capsys):
    """A driver moves the wheel by a sin(2π t), and the only samples are at 0 and 400 s, where its angle is 0.
    Amplitudes of 0.6 rad are followed. Of 30 rad the command reports the angle as unknown, with status 1."""
    sine = {"amplitude": amplitude, "frequency": 2 * np.pi}
    driver = [Driver(joint="J", polynomial=(0.0,), sine=sine)]
    path, table = tmp_path / "wheel.toml", tmp_path / "exact.csv"
    wheel().with_(load=(), driver=driver, duration=400.0).save(path)
    assert main(["reference", str(path), "--samples", "2", "--out", str(table)]) == status
    assert re.findall("unknown: [a-zA-Z.]+", capsys.readouterr().out) == unknown
    angle = np.genfromtxt(table, delimiter=",", names=True)["Jangle_rad"]
    assert angle == pytest.approx([0.0, end], abs=1e-9, nan_ok=True)  # rad
