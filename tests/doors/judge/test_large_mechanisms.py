"""Large random mechanisms: their start, the judge's accelerations on them, and their reduction."""

import numpy as np
import pytest

from crosscheck.conformance import suite
from crosscheck.conformance.changes.copies import replaced
from crosscheck.conformance.findings import fewer_bodies
from crosscheck.conformance.many_mechanisms import Plan, Tally
from crosscheck.conformance.many_mechanisms_table import tables
from crosscheck.conformance.mechanisms.large_graphs import large_graph, massless_graph
from crosscheck.conformance.mechanisms.specimens import Specimen
from crosscheck.conformance.runners import InProcess
from crosscheck.conformance.trial import set_up
from crosscheck.engine import engine, installed
from crosscheck.judge.connected_parts import factored, least_constraint, parts
from crosscheck.judge.constraints import closure, closure_rates, initial_poses, initial_twists, jacobian
from crosscheck.judge.gauss_principle import gauss, rank
from mbref.scene import GROUND, Scene

SMALL = (3, 7, 11, 15)  # seeds of 10 to 15 bodies


def loops(scene: Scene) -> int:
    """Return the number of independent loops, where the ground is a body if a joint holds it."""
    rows = jacobian(scene, 0.0, *initial_poses(scene))[0]
    grounded = sum(GROUND in joint.bodies for joint in scene.joint) > 0
    return len(scene.joint) - len(scene.body) - grounded + len(list(parts(rows))) if len(rows) else 0


@pytest.mark.parametrize("seed", SMALL)
def test_accelerations_found_part_by_part_equal_accelerations_by_singular_values(seed: int):
    """`gauss` is independent: it solves all rows at once. Rounding, 2.2e-16, is magnified by the condition of
    the rows, up to 120 here, and has a margin of 40: 1e-12."""
    expected = gauss(large_graph(seed))
    assert np.abs(least_constraint(large_graph(seed)) - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("seed", SMALL)
def test_joints_of_a_large_mechanism_are_closed_at_the_start_to_rounding(seed: int):
    """Gaps (m, rad) and their rates, of chains of up to 15 bodies a metre long: 1e-12 is 5000 roundings."""
    scene = large_graph(seed)
    pose, rates = initial_poses(scene), initial_twists(scene)
    off = [*closure(scene, 0.0, *pose).values(), *closure_rates(scene, 0.0, *pose, *rates).values()]
    assert max(np.abs(x).max(initial=0.0) for x in off) < 1e-12


def test_accelerations_beside_massless_links_are_those_beside_links_of_vanishing_mass():
    """Masses of 1e-6 and 1e-7 kg (and moments, kg m²) in place of zero change accelerations in proportion."""
    scene = massless_graph(29)
    none, off = least_constraint(scene), []
    for mass in (1e-6, 1e-7):
        light = {"mass": mass, "inertia": (mass, mass, mass)}
        bodies = tuple(body if body.mass else replaced(body, **light) for body in scene.body)
        off.append(np.abs(least_constraint(scene.with_(body=bodies)) - none).max() / np.abs(none).max())
    assert sum(body.mass == 0 for body in scene.body) == 2
    assert 1e-9 < off[0] < 1e-3 and off[1] == pytest.approx(off[0] / 10, rel=0.01)


@pytest.mark.skipif(not installed("mujoco"), reason="MuJoCo is not installed")
@pytest.mark.parametrize(
    ("seed", "says"),
    [(9, "distance joint 'J29' at the massless link 'b17'"), (49, "massless link 'b4': it moves no mass")],
)
def test_massless_links_that_a_tree_of_joints_cannot_have_are_refused_by_name(seed: int, says: str):
    """MuJoCo would take their singular mass matrix: on mechanism 49 its accelerations are 84 % off."""
    assert says in str(engine("mujoco").cannot(massless_graph(seed)))


def test_large_mechanisms_differ_in_parts_loops_and_redundant_rows_and_ranks_of_parts_add_up():
    """Parts are blocks of the Jacobian that share no column: the sum of their ranks must be the rank of the
    whole by singular values, `rank`. Each number has several values on the four mechanisms, so that tests on
    them meet different cases."""
    seen: dict[str, set[int]] = {"parts": set(), "loops": set(), "redundant": set()}
    for scene in map(large_graph, SMALL):
        rows = jacobian(scene, 0.0, *initial_poses(scene))[0]
        ranks = [factored(rows[np.ix_(part.rows, part.columns)]).rank for part in parts(rows)]
        assert sum(ranks) == rank(scene) and loops(scene) > 0
        for name, number in zip(seen, (len(ranks), loops(scene), len(rows) - sum(ranks)), strict=True):
            seen[name].add(number)
    assert all(len(numbers) > 1 for numbers in seen.values()), seen


def test_reduction_drops_bodies_and_keeps_the_loops_that_a_violation_needs():
    """The made-up violation occurs in mechanisms of three loops or more, for which three bodies suffice."""
    small = fewer_bodies(large_graph(11), lambda scene: loops(scene) >= 3)
    assert len(small.body) <= 3 and loops(small) >= 3


def test_violation_on_a_random_mechanism_is_printed_with_its_check_and_numbers():
    """A made-up verdict: on random mechanism 0 the engine's error is 0.5, where 0.001 is allowed."""
    tally, failed = Tally(Plan("mujoco", 1)), suite.Verdict("truth", "drawn_0", suite.FAIL, 0.5, 1e-3, "why")
    tally.add({"version": "1.0", "verdicts": [suite.record_of(failed)]})
    said = [str(block) for block in tables(tally)]
    assert f"fail: drawn_0, {failed.check()}: 0.5, allowed 0.001 why" in said, said


@pytest.mark.parametrize(
    "name", ["pinocchio", "dart", "simbody", pytest.param("sundials", marks=pytest.mark.slow)]
)
def test_ways_of_an_engine_agree_on_loops_that_are_closed_at_the_ground(name: str):
    """The ways of an engine are its algorithms for the same accelerations, of which it has several. The check
    `alternatives` compares them, to the limit that the adapter states. The mechanism has 15 bodies and a loop
    whose first joint is at the ground."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    bench = set_up(InProcess(engine(name)), Specimen(large_graph(3), large=True))
    found = suite.verdict_on("alternatives", bench)
    assert found.status == suite.PASS and len(engine(name).alternatives[0].ways) > 1, found


@pytest.mark.slow
def test_check_alternatives_finds_the_wrong_sparse_jacobian_of_mujoco_4_0_0():
    """MuJoCo 4.0.0 factorises some sparse matrices of several loops wrongly, so that its accelerations differ
    by more than a tenth from its other ways; 3.17.0 does not."""
    mujoco = pytest.importorskip("mujoco")
    trial = set_up(InProcess(engine("mujoco")), Specimen(large_graph(5), large=True))
    found = suite.verdict_on("alternatives", trial)
    is_wrong = mujoco.__version__ == "4.0.0"
    assert found.status == (suite.FAIL if is_wrong else suite.PASS), found
    assert not is_wrong or (found.measured > 0.1 and "'Newton, sparse" in found.reason), found
