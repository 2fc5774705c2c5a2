"""Relations, checks and probes of the suite / limits met exactly, and scenes and motions written down."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from crosscheck.conformance import (
    changes,
    closed_forms,
    features,
    geared_forms,
    planar,
    precise,
    properties,
    relations,
    trial,
)
from crosscheck.conformance.relations import RELATIONS, Isometry
from crosscheck.conformance.trial import Finding, Outside
from crosscheck.engine import Cannot, Owner
from crosscheck.judge.metrics import violation_series
from crosscheck.judge.tolerances import ROUNDING, SAME_MOTION
from mbref import rotations
from mbref.scene import Body, Driver, Moment, Revolute, Scene, Spherical, Translational
from mbref.trajectory import Trajectory

O, X, Z = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def block(name: str = "b", x: float = 0.0, **more: Any) -> Body:
    return Body(**{"name": name, "mass": 1.0, "inertia": (1.0, 1.0, 1.0), "position": (x, 0.0, 0.0), **more})


HINGE = Revolute(name="A", bodies=("ground", "b"), anchor=O, axis=Z)
SLIDE = Translational(name="S", bodies=("b", "c"), anchor=O, axis=X)
SCENE = Scene(name="s", body=(block(), block("c", 2.0)), joint=(HINGE, SLIDE), duration=0.5)


def motion(samples: int = 2, **parts: Any) -> Trajectory:
    """Two bodies with different numbers in every array."""
    shape = (samples, 2, 3)
    made = {
        name: k + np.arange(np.prod(shape)).reshape(shape)
        for k, name in enumerate(
            ("position", "velocity", "angular_velocity", "acceleration", "angular_acceleration")
        )
    }
    wrenches = {name: k + np.arange(6.0 * samples).reshape(samples, 6) for k, name in enumerate("AS")}
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (samples, 2, 1))
    given = {**made, "orientation": turns, "reactions": wrenches, **parts}
    return Trajectory("s", "e", "1", "m", {}, np.linspace(0.0, 0.5, samples), ("b", "c"), **given)


# --- relations ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "matrix", "origin"),
    [
        ("rotated", Rotation.from_rotvec([0.7, -0.4, 1.1]).as_matrix(), O),
        ("turned", Rotation.from_rotvec([0.0, 0.0, 0.8]).as_matrix(), O),
        ("translated", np.eye(3), (0.3, -0.5, 0.0)),
        ("mirrored", [[0.28, -0.96, 0.0], [-0.96, -0.28, 0.0], [0.0, 0.0, 1.0]], O),
    ],
)
def test_places_of_scenes_moved_as_a_whole(name, matrix, origin):
    """A mirror with the normal n = (0.6, 0.8, 0) is 1 - 2 n nᵀ."""
    for found in (
        np.array([body.position for body in RELATIONS[name].change(SCENE, None).body]),
        RELATIONS[name].expect(SCENE, motion(position=np.array([[O, (2.0, 0.0, 0.0)]] * 2))).position[1],
    ):
        assert found == pytest.approx(np.array([O, (2.0, 0.0, 0.0)]) @ np.transpose(matrix) + origin)


def test_a_motion_in_a_mirror():
    """x → -x, then a shift by (1, 2, 3): axial vectors keep x and change the sign of y and z."""
    mirror = Isometry(np.diag([-1.0, 1.0, 1.0]), np.array([1.0, 2.0, 3.0]))
    given, polar, axial = motion(), np.array([-1.0, 1.0, 1.0]), np.array([1.0, -1.0, -1.0])
    found = mirror.expect(given)
    assert found.position == pytest.approx(given.position * polar + [1.0, 2.0, 3.0])
    for name, signs in (
        ("velocity", polar),
        ("acceleration", polar),
        ("angular_velocity", axial),
        ("angular_acceleration", axial),
    ):
        assert getattr(found, name) == pytest.approx(getattr(given, name) * signs), name
    for name, wrench in given.reactions.items():
        assert found.reactions[name] == pytest.approx(wrench * [*polar, *axial])


def test_factors_of_relations():
    """Masses times 2.5; lengths times 4 at half of the speed; millimetres."""
    scene = SCENE.with_(load=(Moment(body="b", moment=Z),))
    heavy = RELATIONS["scaled"].change(scene, None)
    assert (heavy.body[0].mass, heavy.load[0].moment[2]) == (2.5, 2.5) and "2.5" in RELATIONS["scaled"].about
    large, small = (RELATIONS[name].change(scene, None) for name in ("enlarged", "in millimetres"))
    assert (large.body[1].position[0], large.duration) == (8.0, 1.0)
    assert (small.body[1].position[0], small.duration) == (2000.0, 0.5)


def test_reactions_that_are_expected():
    """A driven joint has none; a slide, whose anchors part, has none of exchanged bodies."""
    given = motion()
    driven = SCENE.with_(driver=(Driver(joint="S", polynomial=(0.0, 1.0)),))
    left = relations.undriven(driven, given).reactions
    assert list(left) == ["A"] and left["A"].tolist() == given.reactions["A"].tolist()
    assert list(relations.undriven(SCENE, given).reactions) == ["A", "S"]
    found = relations.opposite(SCENE, given)
    assert {name: wrench.tolist() for name, wrench in found.reactions.items()} == {
        "A": (-given.reactions["A"]).tolist()
    }
    assert found.acceleration.tolist() == given.acceleration.tolist()
    assert found.angular_acceleration.tolist() == given.angular_acceleration.tolist()
    heavy = relations.heavier(SCENE, given)
    assert heavy.acceleration.tolist() == given.acceleration.tolist()
    assert heavy.angular_acceleration.tolist() == given.angular_acceleration.tolist()


def test_shaken_positions_by_their_draws(monkeypatch):
    """A draw of 1 moves a coordinate by the unit of rounding."""
    monkeypatch.setattr(relations, "ROUNDING", 0.25)
    seeds: list[int] = []
    draws = SimpleNamespace(standard_normal=lambda shape: np.full(shape, float(shape != (4,))))
    monkeypatch.setattr(np.random, "default_rng", lambda seed: seeds.append(seed) or draws)
    ball = Spherical(name="B", bodies=("b", "c"), anchor=X)
    found = relations.shaken(SCENE.with_(joint=(HINGE, ball)), 7)
    assert found.body[1].position == (2.25, 0.25, 0.25) and found.joint[1].anchor == (1.25, 0.25, 0.25)
    assert found.joint[0].axis == (0.25, 0.25, 1.25) and seeds == [7]


# --- checks of last digits ----------------------------------------------------------------------------------
def bench(**parts: Any) -> SimpleNamespace:
    made = {
        "scene": SCENE,
        "motion": motion(),
        "exact": motion(),
        "close": motion(),
        "sweep": [motion(), motion()],
        "perturbed": motion(),
        "own_pushes": 1e-3,
        "settings": ["a", "b"],
        "rounding": 1e-16,
    }
    return SimpleNamespace(**{**made, **parts})


def test_numbers_of_single_precision_are_counted(monkeypatch):
    """The first three arrays are named; an engine may declare coarser rounding than double precision."""
    monkeypatch.setattr(precise, "single_precision", lambda scene, run: ["p", "q", "r", "s"])
    assert precise.double_precision(bench()) == Finding(4.0, 0.0, "p, q, r")
    assert precise.double_precision(bench(rounding=ROUNDING)) == Finding(4.0, 0.0, "p, q, r")
    assert isinstance(precise.double_precision(bench(rounding=1.01 * ROUNDING)), Outside)


@pytest.mark.parametrize(
    ("parts", "count"),
    [
        ({}, 4),
        ({"scene": SCENE.with_(body=tuple(Body(name=n, position=O) for n in "bc"))}, 2),
        ({"motion": motion(reactions=None)}, 2),
        ({"motion": motion(reactions={"A": np.zeros((2, 6))})}, 2),
        ({"motion": motion(reactions={}), "scene": SCENE.with_(joint=())}, 2),
    ],
)
def test_reactions_are_balanced_where_all_joints_give_them(monkeypatch, parts, count):
    """Not in scenes without masses, without joints, or with a joint without reactions."""
    for name in ("accelerations_apart", "balance", "idle"):
        monkeypatch.setattr(precise, name, lambda *_: 0.5)
    assert len(list(precise._rates(bench(**parts)))) == count


def test_speeds_that_are_apart(monkeypatch):
    """The larger of 6 m/s over the length of 2 m, and of 4 rad/s, over a rate of 8; of both signs."""
    monkeypatch.setattr(precise, "scene_length", lambda scene: 2.0)
    monkeypatch.setattr(precise, "motion_rate", lambda scene, run: 8.0)

    def apart(name: str, by: float) -> float:
        off = getattr(motion(), name).astype(float)
        off[1, 0, 2] += by
        return precise._speeds_apart(bench(), motion(), motion(**{name: off}))

    assert apart("velocity", 6.0) == apart("velocity", -6.0) == 0.375
    assert apart("angular_velocity", 4.0) == apart("angular_velocity", -4.0) == 0.5


# --- checks at their limits ---------------------------------------------------------------------------------
def test_an_error_at_its_limit(monkeypatch):
    """The bound of the exact motion counts where the error is larger than the resolution."""
    made = bench(resolution=0.25, exact_bound=1.0, floors="f", contraction=0.5)
    for error, allowed in ((0.25, 0.25), (0.26, 1.25)):
        monkeypatch.setattr(properties, "difference", lambda *_, error=error: error)
        assert properties.convergence(made)[:2] == (error, allowed)


def test_a_motion_at_the_limit_of_rest(monkeypatch):
    """The work of a moment is a sum over samples of the whole duration."""
    asked = []
    monkeypatch.setattr(properties, "energy_series", lambda scene, run: np.array([0.25, 0.5]))
    monkeypatch.setattr(properties, "difference", lambda *_: SAME_MOTION)
    made = bench(run=lambda scene, times: asked.append(times.tolist()) or motion())
    assert properties.energy(made).measured == 0.5 and not asked
    monkeypatch.setattr(properties, "difference", lambda *_: 0.99 * SAME_MOTION)
    assert properties.energy(made) == Outside("nothing moves")
    made.scene = SCENE.with_(load=(Moment(body="b", moment=Z),))
    properties.energy(made)
    assert asked == [np.linspace(0.0, 0.5, 65).tolist()]


def test_poses_before_the_motion_is_at_rest(monkeypatch):
    """Energy is asked of motions that leave their first sample."""
    seen = []
    monkeypatch.setattr(properties, "difference", lambda scene, run, rest: seen.append((run, rest)) or 0.0)
    properties.energy(bench())
    run, rest = seen[0]
    assert rest.position.tolist() == [run.position[0].tolist()] * 2
    assert rest.times.tolist() == [0.0, 0.0] and rest.acceleration is None and rest.reactions is None


def test_speed_of_slow_motions(monkeypatch):
    """Differences of velocities count relative to the scene's length over its duration at least."""
    still = motion(9, velocity=np.zeros((9, 2, 3)), angular_velocity=np.zeros((9, 2, 3)))
    moved = replace(still, position=np.zeros((9, 2, 3)), times=0.25 * np.arange(9))
    moved.position[5, 1, 0] = 0.5  # 1 m/s between the neighbours of the middle sample
    monkeypatch.setattr(properties, "scene_length", lambda scene: 4.0)
    monkeypatch.setattr(properties, "motion_rate", lambda scene, run: 2.0)
    found = properties.velocities(bench(close=moved, rounding=0.125))
    assert found.measured == pytest.approx(1.0 / 8.0)
    assert found.allowed == pytest.approx(16 * 0.125 / (0.25 * 2.0))


@pytest.mark.parametrize(("length", "wanted"), [(0.5, 0.25), (8.0, 1 / 64)])
def test_accelerations_relative_to_the_largest(monkeypatch, length, wanted):
    """Off by 0.5 of 2 m/s², or of 8 m / (0.5 s)² = 32 m/s²."""
    right, off = np.zeros((2, 4, 3)), np.zeros((2, 4, 3))
    right[:, 1, 0], off[:, 1, 0] = -2.0, -1.5
    exact = motion()
    monkeypatch.setattr(properties, "scene_length", lambda scene: length)
    monkeypatch.setattr(properties, "stacked", lambda scene, run, k: (right if run is exact else off)[k])
    made = bench(exact=exact, times=np.array([0.0, 0.5]))
    assert properties.true_accelerations(made).measured == pytest.approx(wanted)


def test_a_quaternion_that_is_too_short():
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (2, 2, 1))
    turns[1, 0] *= 0.75
    assert properties.unit_orientations(bench(motion=motion(orientation=turns))).measured == 0.25


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_angular_velocities_by_poses_of_any_sign(sign):
    """One body turns at (3, 4, 12) rad/s, the other rests; the later quaternion may be the negative one."""
    rate = np.array([3.0, 4.0, 12.0])
    times = 1e-3 * np.arange(9)
    turns = np.stack([rotations.from_vector(np.outer(times, rate)), np.tile([1.0, 0, 0, 0], (9, 1))], axis=1)
    turns[5] *= sign
    spin, zero = np.zeros((9, 2, 3)), np.zeros((9, 2, 3))
    spin[:, 0] = rate
    near = motion(9, orientation=turns, angular_velocity=spin, velocity=zero, position=zero)
    found = properties.velocities(bench(close=replace(near, times=times)))
    assert found.measured < 1e-9 and found.allowed == properties.LIKE_TRUTH


@pytest.mark.parametrize("check", [properties.true_velocities, precise.settled])
def test_exact_velocities_that_are_partly_unknown(check):
    unknown = motion().velocity.astype(float)
    unknown[1, 0, 2] = np.nan
    assert check(bench(exact=motion(velocity=unknown))) == Outside(
        "the closed form of this scene gives poses only"
    )


@pytest.mark.parametrize(("pushes", "wanted"), [(0.3, 0.2), (0.45, 0.45)])
def test_the_finding_nearest_to_its_limit(monkeypatch, pushes, wanted):
    """0.2 of 0.25 is nearer than 0.3 of 0.5, and 0.45 of 0.5 is nearer still."""
    changed, asked = SCENE.with_(name="changed"), []
    relation = SimpleNamespace(expect=lambda scene, run: "expected")
    monkeypatch.setattr(properties, "RELATIONS", {"r": relation})
    monkeypatch.setattr(properties, "changed", lambda relation, bench: changed)
    expected, found = motion(), motion()
    monkeypatch.setattr(properties, "in_scene_order", lambda scene, run: expected)
    monkeypatch.setattr(properties, "difference", lambda scene, a, b: asked.append((scene, a, b)) or 0.2)
    monkeypatch.setattr(properties, "pushes_apart", lambda *of: asked.append(of) or (pushes, "A"))
    run = lambda scene, times: found if scene is changed and times is expected.times else None  # noqa: E731
    made = bench(
        own_accuracy=0.25, own_pushes=0.5, floors="f", rank=1e-9, run=run, refuses=lambda scene: None
    )
    assert properties.related("r", made).measured == wanted
    assert asked == [(changed, expected, found), (changed, expected, found, 1e-9)]
    rates = [Finding(0.2, 0.25, "v"), Finding(pushes, 0.5, "a")]
    monkeypatch.setattr(precise, "_rates", lambda bench: iter(rates))
    assert precise.settled(bench()).measured == wanted


@pytest.mark.parametrize(
    ("printed", "files", "again"), [("", (), 0), ("a", (), 1), ("", ("f",), 1), ("a", ("f",), 1)]
)
def test_a_run_that_is_not_silent_is_repeated(printed, files, again):
    """What is printed or left once on a machine is allowed."""
    asked: list[Any] = []
    quiet = SimpleNamespace(printed="", files=())
    made = bench(
        finest=SimpleNamespace(printed=printed, files=files),
        times="times",
        observed=lambda *of: asked.append(of) or quiet,
    )
    assert properties.silence(made) == Finding(0.0, 0.0, "") and asked == [(SCENE, "times", "b")] * again


def test_versions_of_checks():
    """Stored verdicts name them: relations are in their third version, four checks in their second."""
    newer = {
        "truth": 2,
        "convergence": 2,
        "energy": 2,
        "repeated": 2,
        "resampled": 3,
        **dict.fromkeys(RELATIONS, 3),
    }
    versions = {name: entry.version for name, entry in properties.PROPERTIES.items()}
    assert versions == {name: newer.get(name, 1) for name in properties.PROPERTIES}
    assert properties.PROPERTIES["closure"].about == (
        "Joints and drivers hold at every sample, by the judge's own joint equations."
    )
    assert properties.PROPERTIES["turned"].about == "Changed scene: rotated about z, the motion rotates too."


# --- probes of features -------------------------------------------------------------------------------------
def test_a_body_whose_motion_is_undetermined():
    scene = features.undetermined()
    assert scene.name == "massless_undetermined" and not scene.has_mass() and not scene.driver
    assert scene.joint == (features.JOINTS["revolute"],) and features.is_undetermined(scene)
    [body] = scene.body
    assert (body.mass, body.inertia, body.position) == (None, None, (0.3, -0.2, 0.1))
    driven = scene.with_(driver=(Driver(joint="J", polynomial=(0.0, 1.0)),))
    assert not features.is_undetermined(driven), "five rows of the hinge and one of its driver"
    assert not features.is_undetermined(scene.with_(body=(features.BODY,)))


def test_a_link_without_mass_between_two_crossing_hinges():
    scene = features.massless_link()
    link, body = scene.body
    assert (link.name, link.mass, link.inertia, link.position) == ("link", 0.0, O, O) and body.name == "body"
    assert [(joint.name, joint.bodies, joint.anchor, joint.axis) for joint in scene.joint] == [
        ("J", ("ground", "link"), O, Z),
        ("K", ("link", "body"), O, (1.0, 0.3, 0.0)),
    ]
    assert scene.name == "massless_link" and scene.duration == 0.2 and scene.gravity == (0.0, -9.81, 0.0)


def test_probes_of_planar_loops(monkeypatch):
    """An engine that refuses the spatial loop and runs the planar ones is planar."""
    scenes = planar.planar_loops()
    assert [specimen.scene for specimen in planar.planar_specimens()] == list(scenes.values())
    assert {name.partition(":")[0] for name in scenes} == {f"planar {name}" for name in planar.MECHANISMS}
    refusal = Cannot(Owner.ENGINE, "no")
    for spatial, flat, is_planar in (
        (refusal, None, True),
        (None, None, False),
        (refusal, refusal, False),
        (None, refusal, False),
    ):
        answers = {"planar four-bar: gravity": flat}
        simulator = SimpleNamespace(cannot=lambda scene, a=answers, s=spatial: a.get(scene.name, s))
        assert planar.is_planar(simulator) is is_planar
        assert planar.left_out(simulator) == (set() if is_planar else set(scenes))
    assert planar.left_out(None) == set(scenes)


def test_a_rod_and_a_block_of_planar_loops():
    """2 kg/m over 5 m along (3, 4); a block of 0.5 kg where both ends coincide."""
    rod, weight = planar._rod("r", (1.0, 1.0), (4.0, 5.0)), planar._rod("w", (1.0, 2.0), (1.0, 2.0))
    assert (rod.mass, rod.position) == (10.0, (2.5, 3.0, 0.0))
    assert rod.inertia == pytest.approx((2e-4, 250 / 12 + 1e-4, 250 / 12 + 1e-4))
    assert rod.orientation == pytest.approx((np.sqrt(0.8), 0.0, 0.0, np.sqrt(0.2)))
    assert (weight.mass, weight.position, weight.inertia) == (0.5, (1.0, 2.0, 0.0), (2e-4, 1e-4, 1e-4))


# --- formulas of exact motions ------------------------------------------------------------------------------
@pytest.mark.parametrize("make", [*closed_forms.CLOSED_FORMS, *geared_forms.GEARED])
def test_formulas_start_at_their_scenes_and_obey_the_joints(make):
    scene, exact = make()
    times = np.linspace(0.0, scene.duration, 4)
    position, orientation = exact(times)
    assert position[0] == pytest.approx(np.array([body.position for body in scene.body]), abs=1e-13)
    start = np.array([body.orientation for body in scene.body])
    assert np.abs(np.sum(orientation[0] * start, axis=1)) == pytest.approx(1.0)
    names = tuple(body.name for body in scene.body)
    zero = np.zeros_like(position)
    run = Trajectory(scene.name, "e", "1", "m", {}, times, names, position, orientation, zero, zero)
    assert violation_series(scene.with_(coupling=()), run).max() < 1e-13


# --- changed numbers ----------------------------------------------------------------------------------------
def test_changes_by_two_units_in_the_last_place():
    """The factor is 1 + 2 · 0.25; numbers that are not given stay so."""
    bodies = block("b", 2.0, velocity=(4.0, 0.0, 0.0)), Body(name="c", position=(0.0, 6.0, 0.0))
    found = changes.nudged(Scene(name="s", body=bodies, gravity=(0.0, -8.0, 0.0)), 0.25)
    first, second = found.body
    assert (first.mass, first.position, first.velocity) == (1.5, (3.0, 0.0, 0.0), (6.0, 0.0, 0.0))
    assert (second.mass, second.position, second.velocity) == (None, (0.0, 9.0, 0.0), None)
    assert found.gravity == (0.0, -12.0, 0.0) and first.inertia == (1.0, 1.0, 1.0)
    assert changes.nudged(SCENE).body[1].position[0] == 2.0 * (1.0 + 2.0 * ROUNDING) != 2.0


def test_another_scene_of_the_same_name():
    """Masses twice as large, and gravity changed by (1, -2, 3) m/s²."""
    found = changes.weighed(
        Scene(name="s", body=(block(), Body(name="c", position=O)), gravity=(1.0, 1.0, 1.0))
    )
    assert found.name == "s" and [body.mass for body in found.body] == [2.0, None]
    assert found.gravity == (2.0, -1.0, 4.0)


# --- estimates of a bench -----------------------------------------------------------------------------------
def estimating(
    monkeypatch: pytest.MonkeyPatch, swept: list[float], perturbed: float = 0.0, **parts: Any
) -> Any:
    """A bench whose runs are numbers, which differ by their difference."""
    monkeypatch.setattr(trial, "difference", lambda scene, a, b: abs(a - b))
    monkeypatch.setattr(trial, "pushes_apart", lambda scene, a, b, rank: (abs(a - b), "of"))
    made = trial.Bench(None, trial.Specimen(SCENE), "", None, [])
    given = {"sweep": swept, "motion": swept[0], "perturbed": swept[0] + perturbed, "rank": 1e-9, **parts}
    made.__dict__.update(given)
    return made


@pytest.mark.parametrize(
    ("swept", "apart", "before", "contraction", "left"),
    [
        ([0.0], 0.0, 0.0, 1.0, 0.0),
        ([0.0, 3.0], 3.0, 0.0, 1.0, 3.0),
        ([0.0, 3.0, 15.0], 3.0, 12.0, 0.25, 1.0),
        ([0.0, 3.0, 303.0], 3.0, 300.0, 0.01, 1 / 3),
        ([0.0, 3.0, 7.0], 3.0, 4.0, 0.75, 3.0),
    ],
)
def test_errors_left_by_the_finest_setting(monkeypatch, swept, apart, before, contraction, left):
    """A contraction c leaves c / (1 - c) of the last difference; c is 0.1 at least and 0.5 at most."""
    made = estimating(monkeypatch, swept)
    assert (made.steps_apart, made.steps_before) == (apart, before)
    assert made.contraction == pytest.approx(contraction) and made.left == pytest.approx(left)


@pytest.mark.parametrize(
    ("swept", "perturbed", "accuracy", "resolution"),
    [
        ([0.0], 0.0, SAME_MOTION, SAME_MOTION),
        ([0.0, 3.0, 15.0], 0.0, 12.0, 4.0),
        ([0.0, 3.0, 15.0], 0.5, 50.0, 50.0),
    ],
)
def test_differences_that_are_allowed(monkeypatch, swept, perturbed, accuracy, resolution):
    """4 times the difference of settings or the error that is left, 100 times that of perturbed runs."""
    made = estimating(monkeypatch, swept, perturbed)
    assert made.own_accuracy == pytest.approx(accuracy) and made.resolution == pytest.approx(resolution)
    wanted = accuracy if len(swept) > 1 else trial.SAME_PUSHES
    assert made.own_pushes == pytest.approx(wanted)
    assert made.floors == (
        f"perturbed runs differ by {perturbed:.1e}, the two finest settings by {made.steps_apart:.1e}"
    )


@pytest.mark.parametrize(
    ("rounding", "left", "wanted"), [(1e-16, 0.0, trial.RANK), (0.25, 0.125, 4.0), (0.125, 0.25, 4.0)]
)
def test_rank_tolerance_of_a_run(monkeypatch, rounding, left, wanted):
    """16 roundings of the engine, or 16 residuals of the run."""
    monkeypatch.setattr(
        trial, "violation_series", lambda scene, run: np.array([0.0, left * len(run.bodies) / 2])
    )
    made = trial.Bench(SimpleNamespace(rounding=rounding), trial.Specimen(SCENE), "", None, [])
    made.__dict__["motion"] = motion()
    assert made.rank == wanted


@pytest.mark.parametrize(("rate", "step"), [(2.0, 5e-5), (50.0, 2e-5)])
def test_neighbouring_samples(monkeypatch, rate, step):
    """A ten-thousandth of 0.5 s, or the time in which the bodies turn by a thousandth of a radian."""
    monkeypatch.setattr(trial, "motion_rate", lambda scene, run: rate * scene.duration / run.times[-1])
    made = trial.Bench(None, trial.Specimen(SCENE), "", None, [])
    made.__dict__["motion"] = motion()
    monkeypatch.setattr(trial.Bench, "run", lambda self, scene, times: times)
    assert made.close == pytest.approx(0.25 + step * np.arange(-4, 5))
    assert made.times == pytest.approx(np.linspace(0.0, 0.5, 9))


def test_runs_that_share_a_process(monkeypatch):
    """The second of two runs, and the run after that of another scene of the same name."""
    asked: list[Any] = []

    def in_turn(tasks: Any, times: np.ndarray) -> list[str]:
        asked.extend(tasks)
        return ["first", "second", "other", "after"]

    monkeypatch.setattr(trial, "completed", lambda scene, run, samples: (run, samples))
    made = trial.Bench(SimpleNamespace(in_turn=in_turn), trial.Specimen(SCENE), "", None, ["c", "m", "f"])
    assert made.shared_runs == [("second", 9), ("after", 9)]
    assert asked == [(SCENE, "c"), (SCENE, "f"), (changes.weighed(SCENE), "f"), (SCENE, "f")]


@pytest.mark.parametrize("deep", [False, True])
def test_scenes_to_which_relations_are_applied(monkeypatch, deep):
    """Some scenes, or all but those with couplings and the dead end; a scene of the paper counts once."""
    monkeypatch.setattr(trial, "feature_scenes", lambda: {"loop": SCENE, "own": SCENE.with_(name="four_bar")})
    monkeypatch.setattr(trial, "moving_probes", lambda: {"spinning loop": SCENE.with_(name="spinning loop")})
    monkeypatch.setattr(trial, "mechanism", lambda seed: SCENE.with_(duration=1.0 + seed))
    found = {s.scene.name: s for s in trial.specimens.__wrapped__(deep)}
    last = len(geared_forms.GEARED) + 1
    assert list(found)[-last:] == [*(make()[0].name for make in geared_forms.GEARED), "dead end"]
    assert not any(s.related for s in list(found.values())[-last:]) and "own" not in found
    named = {name for name in found if name in trial.RELATED}
    assert {"loop", "spinning loop", "drawn loop", "pendulum"} <= set(found) and "loop" not in named
    assert {name for name, s in found.items() if s.related} == (set(list(found)[:-last]) if deep else named)
    assert [found[name].scene.duration for name in ("drawn loop", "drawn driven loop")] == [1.0, 2.0]


def test_scenes_of_the_suite():
    quick = trial.specimens()
    names = [specimen.scene.name for specimen in quick]
    assert len(set(names)) == len(names)
    assert {s.scene.name for s in quick if s.related} == set(trial.RELATED)
    assert [s.scene.name for s in quick if s.dead_end] == ["dead end"]
    assert {"loop", "free body", "fixed joint", "heavy top"} < set(names)
    assert "driven loop" not in names, "a scene with a truth of its own counts once"
    ends = {s.scene.name: s.scene.duration for s in quick if s.scene.name in trial.SHORT}
    assert ends == {
        "four_bar": 0.01,
        "four_bar_gravity": 0.12,
        "planar_slider_crank": 0.1,
        "spatial_slider_crank": 0.02,
        "spatial_slider_crank_driven": 0.02,
    }
    drawn = {s.scene.name: len(s.scene.driver) for s in quick if s.scene.name.startswith("drawn")}
    assert drawn == {"drawn loop": 0, "drawn driven loop": 1}


def swung(acceleration: Any, angle: float) -> Any:
    """Angles at times from the start of a motion from rest, with an acceleration by angle and rate."""

    def angles(times: np.ndarray) -> np.ndarray:
        found = solve_ivp(
            lambda t, y: (y[1], acceleration(*y)),
            (0.0, times[-1]),
            (angle, 0.0),
            "DOP853",
            times,
            rtol=1e-11,
            atol=1e-13,
        )
        return found.y[0] - angle

    return angles


G = 9.81
ANGLES = {
    # kg, m, kg m², N m/rad: the moment over the moment of inertia about the axis
    "free_fall": lambda t: 2.0 * t,
    "pendulum": swung(lambda a, w: -2.0 * G * 0.4 * np.sin(a) / 0.35, 1.2),
    "torsion": swung(lambda a, w: (6.0 * (0.9 - a) - 0.2 * w) / 0.35, 0.0),
    "driven": lambda t: t - 0.5 * t**2 + 0.3 * np.sin(5.0 * t),
    "turntable": lambda t: 1.5 * t + 2.0 * t**2,
    "gear pair": lambda t: 25.0 / 2 * t**2 * np.array([[1.0], [-0.5]]),
    "rack": lambda t: -1.5 * G / 81.5 / 0.05 / 2 * t**2 * np.array([[1.0], [0.0]]),
    "screw": lambda t: -2.0 * G * 0.01 / 0.0202 / 2 * t**2,
    "armature pendulum": swung(lambda a, w: -2.0 * G * 0.5 * np.cos(a) / 0.83, 0.0),
}
PLACES = {
    "free_fall": lambda t: np.array([0.1 + t, 0.2 + 3.0 * t - G / 2 * t**2, 0 * t]),
    "oscillator": lambda t: np.array(
        [0.8 + swung(lambda x, v: -25.0 * (x - 0.5) - 1.5 * v, 0.8)(t), 0 * t, 0 * t]
    ),
    "rack": lambda t: np.array([0.05 + 0 * t, 0.2 - 1.5 * G / 81.5 / 2 * t**2, 0 * t]),
    "screw": lambda t: np.array([0 * t, 0 * t, -2.0 * G * 1e-4 / 0.0202 / 2 * t**2]),
}
FORMULAS = {make()[0].name: make for make in (*closed_forms.CLOSED_FORMS, *geared_forms.GEARED)}


@pytest.mark.parametrize("name", FORMULAS)
def test_formulas_obey_newton_and_euler(name):
    """Angles about z and places by an integration of the equation of motion, or by its polynomial."""
    scene, exact = FORMULAS[name]()
    times = np.linspace(0.0, scene.duration, 6)
    position, orientation = exact(times)
    turned = np.unwrap(2 * np.arctan2(orientation[..., 3], orientation[..., 0]), axis=0, period=4 * np.pi)
    wanted = np.reshape(ANGLES.get(name, np.zeros_like)(times), (-1, len(times))).T
    assert np.cos(turned - wanted) == pytest.approx(1.0, abs=1e-14), name
    assert np.sin(turned - wanted) == pytest.approx(0.0, abs=1e-8), name
    if name in PLACES:
        assert position[:, -1] == pytest.approx(PLACES[name](times).T, abs=1e-9)


def test_motions_that_a_bench_compares(monkeypatch):
    """Pushes of the run with those of the perturbed run, and with those of the next coarser setting."""
    asked: list[Any] = []
    made = trial.Bench(SimpleNamespace(rounding=0.25), trial.Specimen(SCENE), "", None, [])
    monkeypatch.setattr(trial, "pushes_apart", lambda *of: asked.append(of) or (0.0, "of"))
    made.__dict__.update(motion="run", perturbed="perturbed", sweep=["run", "coarser"], rank=1e-9)
    assert made.own_pushes == trial.SAME_PUSHES
    made.__dict__.pop("own_pushes")
    made.__dict__["sweep"] = ["run"]
    assert made.own_pushes == trial.SAME_PUSHES
    wanted = [(SCENE, "run", other, 1e-9) for other in ("perturbed", "coarser", "perturbed", "run")]
    assert asked == wanted


def test_the_perturbed_run_and_the_exact_motion_of_a_bench(monkeypatch):
    made = trial.Bench(SimpleNamespace(rounding=0.25), trial.Specimen(SCENE), "", None, [])
    monkeypatch.setattr(trial, "nudged", lambda *of: ("nudged", *of))
    monkeypatch.setattr(trial.Bench, "run", lambda self, *of: of)
    monkeypatch.setattr(trial, "exact_motion", lambda *of: ("exact", *of))
    monkeypatch.setattr(trial, "exact_bound", lambda *of: ("bound", *of))
    assert made.perturbed == (("nudged", SCENE, 0.25), made.times)
    assert made.exact == ("exact", made.specimen, made.times)
    assert made.exact_bound == ("bound", made.specimen, made.exact)
