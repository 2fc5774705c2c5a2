"""The judge's reference against closed forms, formulations and precisions; its bound, limits and cache."""

import json
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import mbref
from crosscheck.cli.scene_request import find_certifiable
from crosscheck.conformance.changes.isometry import ASKEW, Isometry
from crosscheck.conformance.mechanisms.closed_forms import free_fall, pendulum
from crosscheck.conformance.mechanisms.features import massless, undetermined
from crosscheck.conformance.mechanisms.moving import moving_probes, several_springs
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.judge import constraints, metrics
from crosscheck.judge.arithmetic import DOUBLE, EXTENDED, doubles, many_digits
from crosscheck.judge.deadline import GivenUp, given_up
from crosscheck.judge.reference import cache
from crosscheck.judge.reference import reference as module
from crosscheck.judge.reference.bound import differences
from crosscheck.judge.reference.certify import NotCertified, certified, digest
from crosscheck.judge.reference.isostatic import isostatic, replaced
from crosscheck.judge.reference.reference import Reference, judged, reference, runs
from crosscheck.judge.reference.saddle_point import SaddlePoint
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from crosscheck.judge.truth import closed_form, truth_for
from crosscheck.judge.truth.reference_truth import trajectory
from crosscheck.study.comparison import Wanted, collected
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Driver, Scene, TorsionSpring
from mbref.scenes import SCENES
from tests.helpers.truth_scenes import ALL

SMOOTH = 1e-12  # bound where nothing is singular
CROSSED = 4e-10  # bound after singular positions: ten times the largest measured, of five_bar_gravity
AGREE = 1e-15  # m, or of the length: difference of two formulations over a short smooth motion
SECONDS = 200.0
SEEDS = (2, 3, 4, 5, *range(10, 26))  # seeds of the random mechanisms in this file
SINGULAR = ("four_bar", "four_bar_quarter", "four_bar_gravity", "five_bar", "five_bar_gravity")
SINGULAR += ("crank_torsion", "slider_spring")
SINGULAR += tuple(f"planar_slider_crank_{variant}" for variant in ("equal", "gravity", "heavy"))
SINGULAR_START = ("four_bar_straight",)
QUICK = ("four_bar_gravity", "pendulum_all", "free_spring", "four_bar_chain")
BRIEF = {  # durations (s), shorter than the scene's
    "planar_slider_crank_heavy": 4.0,
    "planar_slider_crank": 0.1,
    "spatial_slider_crank": 0.03,
    "slider_spring": 0.3,
    "crank_torsion": 0.3,
    "planar_slider_crank_gravity": 0.5,
    "planar_slider_crank_equal": 0.1,
}


def samples(scene: Scene, duration: float, count: int = 9, seconds: float = SECONDS) -> tuple[Reference, str]:
    """A reference that is not taken from the cache, and the reason of an early end, or ""."""
    times = np.linspace(0.0, duration, count)
    return judged(scene, times, *runs(scene, times, seconds))


def errors(scene: Scene, found: Reference, exact: Trajectory) -> np.ndarray:
    return metrics.error_series(scene, trajectory(scene, found), exact)


def test_bound_of_a_mechanism_far_from_the_origin_holds_the_rounding_of_its_samples():
    """A pendulum of 1 m is 1e6 m from the origin: samples rounded to doubles lose up to 1e-10 of its length,
    here more than 1e-12. The same motion is passed as all three runs of the reference, which then do not
    differ. The bound covers the loss alone, and is below 1e-9."""
    scene, _ = pendulum()
    far = Isometry(np.eye(3), np.array([1e6, 0.0, 0.0])).change(scene)
    motion = natural_motion(far, [0.0, 0.4, 0.8], EXTENDED, seconds=SECONDS)
    found, _ = judged(far, motion.times, motion, motion, motion)
    lost = np.abs(EXTENDED.array(found.position) - motion.position).max() / constraints.scene_length(far)
    assert 1e-12 < lost < found.bound.max() < 1e-9


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=[pytest.mark.slow] * (n not in QUICK))
        for n in sorted(set(ALL) - {*SINGULAR_START})
    ],
)
def test_reference_is_within_its_bound_of_a_known_motion(name):
    """The error is the difference from the closed form. The bound is at most 1e-12 of the length or rad; over
    singular positions (SINGULAR) 4e-10, ten times the largest measured."""
    scene = ALL[name]
    found, reason = samples(scene, BRIEF.get(name, scene.duration))
    truth = closed_form(scene)
    assert not reason, reason
    assert (errors(scene, found, truth.poses(found.times)) <= found.bound).all()
    assert found.bound.max() <= (CROSSED if name in SINGULAR else SMOOTH)


def test_reference_with_contradicting_joints_is_within_its_bound_of_the_exact_motion():
    """Bricard's linkage turned askew has rounded axes, which contradict each other; it moves as the exact
    one, turned. The contradiction exceeds CONSISTENT, the judge's limit for joints without any."""
    scene = SCENES["bricard"]()
    times, turned = np.linspace(0.0, 0.3, 4), Isometry(ASKEW, np.array([0.3, -0.5, 0.2]))
    exact = natural_motion(scene, times, EXTENDED, seconds=SECONDS)
    askew = natural_motion(turned.change(scene), times, EXTENDED, seconds=SECONDS)
    assert exact.contradiction < module.CONSISTENT < askew.contradiction
    found, reason = judged(turned.change(scene), times, *runs(turned.change(scene), times, SECONDS))
    assert not reason
    assert np.abs(found.position - turned.place(doubles(exact.position))).max() <= found.bound.max()


def test_tree_formulation_passes_the_flat_linkage_of_bennett_in_few_panels():
    """One of two rows that close Bennett's linkage vanishes where it is flat. A solver that keeps this row
    needs many short panels for 1 s; a solver that changes to the other row needs fewer than 10."""
    motion = tree_motion(SCENES["bennett"](), np.linspace(0.0, 1.0, 3), EXTENDED, seconds=SECONDS)
    assert not motion.reason and motion.steps < 10


def test_panels_of_a_stiff_governor_are_as_long_as_its_smooth_motion_allows():
    """Dampers of the governor act in 40 µs, but its motion is smooth: 0.4 s need fewer than 40 panels, where
    Picard's iteration would take 20 panels to 7 ms. The motion is formulation A's to 1e-15 of the length."""
    scene, times = SCENES["flyball_governor"](), np.linspace(0.0, 0.4, 5)
    motion = tree_motion(scene, times, EXTENDED, seconds=SECONDS)
    assert not motion.reason and motion.steps < 40
    assert differences(scene, natural_motion(scene, times, EXTENDED, seconds=SECONDS), motion).max() < AGREE


def test_choice_of_rows_moves_contradicting_joints_by_rounding_only():
    """Bennett's linkage with rounded axes, in formulation B: another seed selects other rows and displaces
    joints by 2e-16. The motion differs, by more than 1e-17 and at most 50 times the displacement, 1e-14; an
    equal seed gives it to the last bit."""
    scene = Isometry(ASKEW, np.array([0.3, -0.5, 0.2])).change(SCENES["bennett"]())
    one, same, other = (
        tree_motion(scene, [0.5], EXTENDED, seconds=SECONDS, seed=seed, displaced=displaced)
        for seed, displaced in ((0, 0.0), (0, 0.0), (1, 2e-16))
    )
    assert (one.position == same.position).all()
    assert 1e-17 < differences(scene, one, other).max() < 1e-14


def test_rows_that_become_dependent_do_not_magnify_contradictions():
    """Two hinges contradict each other by 1e-16, so that seeds of the rows change the motion: by less than
    2e-15, where a bad choice of rows would magnify this to 3e-13."""
    spring = TorsionSpring(joint="J1", stiffness=5.0, damping=0.1, natural_angle=0.3)
    drawn = random_mechanism(12)
    scene = drawn.with_(load=(*drawn.load, spring))
    one, other = (natural_motion(scene, [0.5], EXTENDED, seconds=SECONDS, seed=n) for n in (0, 2))
    assert 0 < differences(scene, one, other).max() < 2e-15


def test_double_precision_gives_thirteen_digits():
    """On a pendulum of 1 m, formulation A is within 1e-13 m of its run in extended precision."""
    scene, _ = pendulum()
    times = np.linspace(0.0, 0.8, 5)
    one, other = (natural_motion(scene, times, a, seconds=SECONDS) for a in (DOUBLE, EXTENDED))
    assert one.position.dtype == float
    assert np.abs(np.asarray(one.position - other.position, dtype=float)).max() < 1e-13


def test_saddle_points_are_solved_to_two_hundred_roundings():
    """M x + Jᵀ y = f and J x = r with random matrices hold to 200 roundings of extended precision, 1e-19
    each: sums of 13 products, and a solve, round tens of times."""
    rng = np.random.default_rng(3)
    root, rows = rng.normal(size=(8, 8)), rng.normal(size=(5, 3, 8))
    mass = EXTENDED.array(root @ root.T)
    force, rate = EXTENDED.array(rng.normal(size=(3, 8))), EXTENDED.array(rng.normal(size=5))
    x, y = SaddlePoint(mass, EXTENDED.array(rows), EXTENDED.zeros(len(rows)), EXTENDED).solve(force, rate)
    left = x @ mass + np.einsum("m,min->in", y, EXTENDED.array(rows)) - force
    assert np.abs(left).max() < 200 * EXTENDED.eps * np.abs(x).max() * np.abs(mass).max()
    assert np.abs(np.einsum("min,in->m", rows, x) - rate).max() < 200 * EXTENDED.eps * np.abs(x).max()


def test_certified_table_of_a_pendulum_has_twenty_digits_and_the_place_of_the_closed_form():
    """The table of a pendulum has a bound of 1e-20, a hash, numbers of 22 digits or more, and the place of
    the closed form in double precision, to 1e-15 m."""
    pytest.importorskip("flint", reason="python-flint is the extra `certify`")
    scene, exact = pendulum()
    table = certified(scene, np.array([0.0, 0.3]), 20)
    assert float(table["bound"]) <= 1e-20 and table["hash"] == digest(table)
    place = np.array(table["position"][1][0], dtype=float)
    assert np.abs(place - exact(np.array([0.3]))[0][0, 0]).max() < AGREE
    assert len(table["position"][1][0][0].strip("-")) >= 22


@pytest.mark.parametrize(
    ("make", "times"),
    [
        (SCENES["heavy_top"], [0.05, 0.06]),
        (SCENES["andrews_squeezer"], [1e-3]),
        (several_springs, [0.02]),
        # residuals of a redundant row are balls around zero
        pytest.param(partial(random_mechanism, 3), [0.05], id="redundant row"),
    ],
)
def test_thirty_digits_and_extended_precision_move_alike(make, times):
    """Formulation A runs in 30 and in 19 digits: positions of up to 1 m, in doubles, agree to 1e-15 m."""
    pytest.importorskip("flint", reason="python-flint is the extra `certify`")
    scene = make()
    motion = natural_motion(scene, times, many_digits(30), order=30, tolerance=1e-20, seconds=SECONDS)
    assert not motion.reason
    other = natural_motion(scene, times, EXTENDED, seconds=SECONDS)
    assert np.abs(doubles(motion.position) - doubles(other.position)).max() < AGREE


def test_contradicting_joints_are_replaced_before_digits_are_certified():
    """Bennett's rounded axes leave three rows that contradict each other by 1e-17 and more. The table states
    the joints that replace others; its places are the reference's to 1e-15 m."""
    pytest.importorskip("flint", reason="python-flint is the extra `certify`")
    scene = SCENES["bennett"]()
    table = certified(scene, np.array([0.0, 0.02]), 20)
    assert float(table["bound"]) <= 1e-20 and table["replaced"] == replaced(scene, isostatic(scene))
    motion = natural_motion(scene, table["times"], EXTENDED, seconds=SECONDS)
    assert np.abs(motion.position - np.array(table["position"], dtype=np.longdouble)).max() < AGREE


def test_start_in_a_singular_position_is_not_certified():
    """The straight four-bar's motion is undetermined at its start; the error has the time and the reason."""
    pytest.importorskip("flint", reason="python-flint is the extra `certify`")
    with pytest.raises(NotCertified, match="A ends at t = 0 s: it starts in a singular position"):
        certified(SCENES["four_bar_straight"](), np.array([0.0, 1e-4]), 20)


@pytest.mark.parametrize("name", ["bennett", "four_bar_gravity", "h_frame", "random_12"])
def test_isostatic_scene_keeps_the_freedoms_and_has_no_redundant_row(name):
    """Joints of the scene with redundant rows are replaced by weaker ones; mbref counts rows and freedoms."""
    scene = find_certifiable(name)
    before, after = mbref.counts(scene), mbref.counts(isostatic(scene))
    assert before.redundant > after.redundant == 0
    assert before.degrees_of_freedom == after.degrees_of_freedom
    assert replaced(scene, isostatic(scene)) and not replaced(scene, scene)


def test_isostatic_scene_along_a_motion_has_no_singular_position():
    """Joints weakened by the rank at the start alone make Bennett's linkage singular where it is flat; those
    weakened by the rank along the motion do not, and contradict each other by less than 1e-17."""
    scene = SCENES["bennett"]()
    motion = natural_motion(scene, np.linspace(0.0, 1.0, 41), EXTENDED, seconds=SECONDS)
    poses = doubles(motion.position), doubles(motion.orientation)
    weakened = isostatic(scene), isostatic(scene, list(zip(motion.times.tolist(), *poses, strict=True)))
    one, other = (natural_motion(each, [1.0], EXTENDED, seconds=SECONDS) for each in weakened)
    assert one.crossings and not other.crossings
    assert other.contradiction < 1e-17 < motion.contradiction


def test_isostatic_door_keeps_its_driven_hinge_alone():
    """Either of the door's two hinges leaves its freedom. The driven one, last in the list, is kept."""
    door = moving_probes()["door"]
    *others, last = door.joint
    driven = door.with_(driver=(Driver(joint=last.name, polynomial=(0.0, 1.0)),))
    assert replaced(driven, isostatic(driven)) == {joint.name: "removed" for joint in others}


TABLES = {path.stem: path for path in (Path(cache.__file__).parent / "certified").glob("*.json")}


def test_every_scene_except_the_singular_start_has_a_certified_table():
    """TABLES are the files of the package; 20 random mechanisms have one, too."""
    assert set(TABLES) == set(SCENES) - {*SINGULAR_START} | {f"random_{seed}" for seed in SEEDS}


def test_certified_tables_are_unedited_and_bounded_by_1e_20():
    """The hash is the digest of the numbers; a later version names the table that it supersedes."""
    for path in TABLES.values():
        table = json.loads(path.read_text())
        assert table["hash"] == digest(table), f"{path.name} was edited"
        assert table["digits"] == 20 and float(table["bound"]) <= 1e-20
        assert (table["version"] > 1) == ("supersedes" in table)


BRIEFLY = [name for name, path in TABLES.items() if json.loads(path.read_text())["times"][-1] <= 0.05]


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name not in BRIEFLY or name not in SCENES))
        for name in sorted(TABLES)
    ],
)
def test_reference_is_within_its_bound_of_the_certified_table(name):
    """The table has positions of twenty digits by two runs in 30 digits. Errors are over the length."""
    scene, table = find_certifiable(name), json.loads(TABLES[name].read_text())
    found, reason = judged(scene, table["times"], *runs(scene, table["times"], SECONDS))
    assert not reason
    place = np.array(table["position"], dtype=np.longdouble)
    off = np.linalg.norm(found.position - place, axis=-1).max(axis=-1) / constraints.scene_length(scene)
    assert (off <= found.bound).all()


def test_reference_names_a_body_that_turns_without_inertia():
    """The free pole has no moment of inertia about its axis x."""
    pole = Body(name="pole", mass=1.0, inertia=(0.0, 0.1, 0.1), position=(0.0, 0.0, 0.0))
    motion = natural_motion(Scene(name="rod", body=(pole,)), [0.1], EXTENDED, seconds=SECONDS)
    assert motion.reason == "body 'pole' can turn without inertia"


def test_reference_moves_massless_bodies_only_if_driven():
    """A mechanism with a free joint and no masses is refused; the driven rhombus without masses is not."""
    motion = natural_motion(undetermined(), [0.1], EXTENDED, seconds=SECONDS)
    assert motion.reason == "bodies without mass have to be driven in every freedom"
    driven = massless(SCENES["four_bar"]()).with_(duration=0.01)
    assert not natural_motion(driven, [0.01], EXTENDED, seconds=SECONDS).reason


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "mbref" / "references"


def test_reference_that_is_given_up_ends_and_is_not_cached(own_cache):
    """A reference that would take ten minutes is given up from another thread, and ends within a minute."""
    scene, times = SCENES["flyball_governor"]().with_(duration=1e4), np.linspace(0.0, 1e4, 11)
    with ThreadPoolExecutor(1) as beside:
        motion = beside.submit(reference, scene, times, 600.0)
        while not motion.running():
            time.sleep(0.01)
        with given_up(), pytest.raises(GivenUp):
            motion.result(timeout=60.0)
    assert not own_cache.exists()


def test_interrupt_does_not_wait_for_the_truth(own_cache):
    """The command ends while the reference of its scene would take ten minutes."""
    scene = SCENES["flyball_governor"]().with_(duration=1e4)
    wanted = Wanted([np.linspace(0.0, 1e4, 11)], reference_time=600.0, is_quick=True)

    def interrupt():
        raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as beside:
        command = beside.submit(collected, [scene], [], wanted, interrupt, print)
        assert isinstance(command.exception(timeout=60.0), KeyboardInterrupt)


@pytest.mark.parametrize(
    "damage",
    [lambda b: b[:-7], lambda b: b[:50] + b"x" + b[51:], lambda b: b""],
    ids=["cut short", "changed byte", "empty"],
)
def test_damaged_cache_file_of_a_reference_is_made_again(own_cache, damage):
    """A file that is cut short, changed or empty is not read; the reference is computed again and stored."""
    scene, _ = free_fall()
    first = reference(scene, [0.5])
    (file,) = own_cache.iterdir()
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    assert cache.load(scene) == {}
    assert (reference(scene, [0.5]).position == first.position).all()
    assert cache.load(scene)["bound"].shape == (1,)


def test_reference_needs_no_cache_that_can_be_written(tmp_path, monkeypatch):
    """A file stands where the cache's folder should be; the reference is a fall's closed form, to 1e-15 m."""
    (tmp_path / "mbref").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    scene, exact = free_fall()
    found = reference(scene, [0.5])
    assert np.abs(found.position[0] - exact(np.array([0.5]))[0][0]).max() < AGREE


def test_truth_of_a_scene_without_closed_form_is_its_reference(own_cache):
    """A random mechanism has none: its truth is the reference, whose bound is at most 1e-11 of the length,
    or None without CPU time. The rhombus has the parallelogram's closed form."""
    scene = random_mechanism(3)
    assert truth_for(scene, 0.0) is None
    truth = truth_for(scene)
    assert truth.name == "reference" and truth.accuracy <= 1e-11
    assert np.array_equal(truth.poses(np.array([0.1])).position, reference(scene, [0.1]).position)
    assert truth_for(SCENES["four_bar"]()).name == "parallelogram"
