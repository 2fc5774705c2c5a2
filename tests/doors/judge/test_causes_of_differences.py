"""The cause of a difference is named: a change of the exact motion's table, or of its scene."""

import functools
import itertools
import time
from collections.abc import Callable

import numpy as np
import pytest

import crosscheck
from crosscheck.recorded.changed_scenes import changes
from mbref import rotations
from mbref.scene import Scene, Spring, TorsionSpring
from mbref.scenes import find_scene
from tests.helpers.tables import Table, damped_pendulum, double_pendulum, spinning_rod, switched_motor, turned

SCENES: dict[str, Callable[[], Scene]] = {
    **{"damped_pendulum": damped_pendulum, "switched_motor": switched_motor, "spinning_rod": spinning_rod},
    **{"double_pendulum": double_pendulum, "four_bar_gravity": lambda: find_scene("four_bar_gravity")},
}
NOTHING = "no change that the judge knows"
FITTED = 1e-4  # largest fraction of the difference that remains once the named change is undone


@functools.cache
def known(name: str) -> Table:
    """Return the reference motion of a scene at 41 times, computed once."""
    return motion(SCENES[name]())


def motion(scene: Scene, times: np.ndarray | None = None) -> Table:
    """Return the reference motion of a scene, by default at 41 times of its duration."""
    times = np.linspace(0.0, scene.duration, 41) if times is None else times
    return {n: c for n, c in crosscheck.reference_table(scene, times).items() if n != "bound"}


def scaled(factor: float, *ends: str) -> Callable[[Scene, Table], Table]:
    """Return the change of columns with a part of these names by a factor."""
    return lambda _, t: {n: c * (factor if any(e in n for e in ends) else 1.0) for n, c in t.items()}


def rotation_vectors(q: np.ndarray) -> np.ndarray:
    q = np.where(q[:, :1] < 0, -q, q)
    size = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    angle = 2 * np.arctan2(size, q[:, :1])
    return np.hstack([0 * angle, q[:, 1:] * np.where(size > 0, angle / np.maximum(size, 1e-300), 2.0)])


def faster_clock(scene: Scene, table: Table) -> Table:
    return {**motion(scene, table["time"] / (1 + 1e-4)), "time": table["time"]}


def later(scene: Scene, table: Table) -> Table:
    times = table["time"][3:]
    return {**motion(scene, times - 0.3 * times[0]), "time": times}


def exchanged(scene: Scene, table: Table) -> Table:
    x, y = (f"{scene.body[-1].name}.position.{a}" for a in "xy")
    return {**table, x: table[y], y: table[x]}


def another_point(moves: bool) -> Callable[[Scene, Table], Table]:
    """Return the change of a body's velocities, and of its positions if ``moves``, to another point."""

    def of(scene: Scene, table: Table) -> Table:
        body = scene.body[-1].name
        q = np.array([table[f"{body}.orientation.{a}"] for a in "wxyz"]).T
        spin = np.array([table[f"{body}.angular_velocity.{a}"] for a in "xyz"]).T
        arm = rotations.rotate(q, np.array([0.1, 0.2, 0.0]))
        found = {n: c for n, c in table.items() if "acceleration" not in n}
        for i, a in enumerate("xyz"):
            found[f"{body}.velocity.{a}"] = table[f"{body}.velocity.{a}"] + np.cross(spin, arm)[:, i]
            if moves:
                found[f"{body}.position.{a}"] = table[f"{body}.position.{a}"] + arm[:, i]
        return found

    return of


def wrapped(_: Scene, table: Table) -> Table:
    return {n: np.angle(np.exp(1j * c)) if n.endswith(".angle") else c for n, c in table.items()}


def heavier(scene: Scene, table: Table) -> Table:
    return motion(scene.with_(gravity=tuple(1.01 * g for g in scene.gravity)))


def angles_alone(change: Callable[[Scene, Table], Table]) -> Callable[[Scene, Table], Table]:
    """Return a change of which the table shows angles alone."""
    return lambda s, t: {n: c for n, c in change(s, t).items() if n == "time" or n.endswith(".angle")}


def drifting(scene: Scene, table: Table) -> Table:
    return {n: c if n == "time" else c + 1e-3 * table["time"] ** 2 for n, c in table.items()}


def noisy(scene: Scene, table: Table) -> Table:
    rng = np.random.default_rng(5)
    return {n: c if n == "time" else c + 1e-3 * rng.standard_normal(len(c)) for n, c in table.items()}


def rows(choose: Callable[[np.ndarray], np.ndarray], *parts: str) -> Callable[[Scene, Table], Table]:
    """Return the change of columns with these parts in their names, by default of all, to other rows, whose
    numbers ``choose`` returns; the times stay."""

    def of(_: Scene, table: Table) -> Table:
        chosen = choose(np.arange(len(table["time"])))
        changes = {n: n != "time" and any(p in n for p in parts or ("",)) for n in table}
        return {n: c[chosen] if changes[n] else c[: len(chosen)] for n, c in table.items()}

    return of


def in_body_axes(*kinds: str) -> Callable[[Scene, Table], Table]:
    """Return the change of velocities to components along the axes of the body, as engines compute them."""

    def of(scene: Scene, table: Table) -> Table:
        found = dict(table)
        for body, kind in itertools.product(scene.body, kinds):
            names = [f"{body.name}.{kind}.{a}" for a in "xyz"]
            q = np.array([table[f"{body.name}.orientation.{a}"] for a in "wxyz"]).T
            inner = rotations.rotate(rotations.conjugate(q), np.array([table[n] for n in names]).T)
            found.update(zip(names, inner.T, strict=True))
        return found

    return of


def half_a_step_late(scene: Scene, table: Table) -> Table:
    """Velocities of a leapfrog method: half a step after the positions."""
    late = motion(scene, table["time"] + table["time"][1] / 2)
    return {n: late[n] if "velocity" in n or "rate" in n else c for n, c in table.items()}


def shuffled(scene: Scene, table: Table) -> Table:
    rng = np.random.default_rng(6)
    return {n: c if n == "time" else rng.permutation(c) for n, c in table.items()}


def changed(path: str, value: object) -> Callable[[Scene, Table], Table]:
    """Return the motion of the scene with another value of a field."""
    return lambda scene, table: motion(scene.with_(path, value))


LENGTHS = (".position", ".velocity", ".acceleration", ".displacement")
ANGLES = (".angle", ".rate", ".angular_", "load(0).rate")
# change of a table, and a part of its explanation; "r.position.x" is of bodies whose names end with r
EVERYWHERE = {
    "mm": (scaled(1e3, ".position"), "in mm, not m"),
    "all lengths in mm": (scaled(1e3, *LENGTHS), "in mm, not m"),
    "degrees": (scaled(180 / np.pi, ".angle"), "degrees"),
    "angles and rates in degrees": (scaled(180 / np.pi, *ANGLES), "degrees"),
    "sign of a component": (scaled(-1.0, "r.position.x", "d.position.x"), "opposite sign"),
    "sign of a joint": (scaled(-1.0, "A.angle", "A.rate"), "opposite sign"),
    "order of quaternions": (turned(lambda q: q[:, [1, 2, 3, 0]]), "order x, y, z, w"),
    "conjugate quaternions": (turned(rotations.conjugate), "opposite rotation"),
    "rotation vectors": (turned(rotation_vectors), "rotation vectors"),
    "axes": (exchanged, "x, y, z hold y, x, z"),
    "velocities of another point": (another_point(moves=False), "a point at (0.1, 0.2"),
    "another point": (another_point(moves=True), "a point at (0.1, 0.2"),
    "velocities in body axes": (in_body_axes("velocity"), "velocity along the axes of the body"),
    "drift": (drifting, NOTHING),
    "noise": (noisy, NOTHING),
    "shuffled rows": (shuffled, NOTHING),
    "zeros": (scaled(0.0, "r.velocity.x", "d.velocity.x"), NOTHING),
}
MORE = {  # slow everywhere
    "inches": (scaled(1 / 0.0254, ".position"), "in inches, not m"),
    "turns a minute": (scaled(30 / np.pi, ".angular_velocity"), "in revolutions a minute, not rad/s"),
    "held values": (rows(lambda k: k // 2 * 2), "each value is repeated for"),
    "a lost row": (rows(lambda k: np.delete(k, 17)), NOTHING),
    "rows of a body a row late": (rows(lambda k: np.maximum(k - 1, 0), "r.", "d."), NOTHING),
    "a column that stays": (rows(lambda k: 0 * k, "r.position.y", "d.position.y"), NOTHING),
    "reversed rows": (rows(lambda k: k[::-1]), NOTHING),
    "half a step": (half_a_step_late, "all velocities and rates: earlier by 0.0"),
}
SIMULATED = {
    "clock": (faster_clock, "clock of the table is fast by 0.0001"),
    "clock, angles alone": (angles_alone(faster_clock), "clock"),
    "later": (later, "later by"),
    "gravity": (heavier, "gravity of"),
    "gravity, angles alone": (angles_alone(heavier), "gravity of"),
}
SPINS = "velocity and angular velocity along the axes of the body"
OF_ONE_SCENE = {
    "double_pendulum": {"body axes": (in_body_axes("velocity", "angular_velocity"), SPINS)},
    "four_bar_gravity": {  # five causes explain the two equal angles of a parallelogram
        "clock, angles alone": (angles_alone(faster_clock), NOTHING),
        "gravity, angles alone": (angles_alone(heavier), NOTHING),
    },
    "spinning_rod": {"wrapped angle": (wrapped, "full turns are not counted")},
    "damped_pendulum": {
        "no damping": (changed("load[0].damping", 0.0), "without the damping of load(0)"),
        "less damping": (changed("load[0].damping", 0.1), "damping of load(0) of 0.1, not 0.15"),
        "stiffness": (changed("load[0].stiffness", 2.3), "stiffness of load(0) of 2.3, not 2"),
        "no armature": (changed("joint[A].armature", 0.0), "without the armature of joint 'A'"),
    },
    "switched_motor": {
        "on later": (changed("load[0].factor.start", 0.32), "switched on later by 0.02 s"),
        "off later": (changed("load[0].factor.stop", 0.72), "switched off later by 0.02 s"),
        "torque": (changed("load[0].torque", 2.6), "torque of load(0) of 2.6, not 2.5"),
    },
}


def cases(explained: bool) -> list[object]:
    """Return cases (scene, change, part of the expected sentence) of changes that have an explanation, or
    have none. All except cases of the rod, whose motion is computed fastest, are slow. No gravity acts on the
    rod, so that cases of gravity are of other scenes."""
    found = []
    for scene, own in OF_ONE_SCENE.items():
        for name, case in {**EVERYWHERE, **MORE, **SIMULATED, **own}.items():
            is_slow = scene != "spinning_rod" or name in MORE
            if (case[1] is not NOTHING) == explained and (scene != "spinning_rod" or "gravity" not in name):
                named = {"id": f"{scene}-{name}", "marks": [pytest.mark.slow] * is_slow}
                found.append(pytest.param(scene, *case, **named))
    return found


@pytest.mark.parametrize(("scene", "change", "sentence"), cases(explained=True))
def test_only_explanation_of_a_wrong_table_names_the_change_that_was_made(scene, change, sentence):
    """The table is the exact motion with one change, such as positions in mm, named in the test's id. The
    explanation has ``sentence`` in it, and without the change less than 1e-4 of the difference remains."""
    found = crosscheck.judge_motion(SCENES[scene](), change(SCENES[scene](), known(scene)))
    assert not found.is_right
    (explanation,) = found.explanations
    assert sentence in explanation.sentence and explanation.remains < FITTED


@pytest.mark.parametrize(("scene", "change", "_"), cases(explained=False))
def test_wrong_table_that_no_single_change_explains_is_off_without_explanation(scene, change, _):
    """The exact motion is changed by drift, noise or exchanged rows, or more than three changes fit it."""
    found = crosscheck.judge_motion(SCENES[scene](), change(SCENES[scene](), known(scene)))
    assert not found.is_right and not found.explanations


def exchanged_columns(scene: str, *pairs: tuple[str, str]) -> Table:
    """Return columns of a scene of which pairs are exchanged."""
    table, others = known(scene), (".power", "energy", "acceleration")
    found = {n: c for n, c in table.items() if not any(part in n for part in others)}
    for first, second in pairs:
        found[first], found[second] = table[second], table[first]
    return found


STATES = [f"{kind}.{axis}" for kind in ("position", "velocity") for axis in "xyz"]
UPPER_AND_LOWER = [(f"upper.{state}", f"lower.{state}") for state in STATES]
BODIES = "columns of upper, lower hold columns of lower, upper of the exact motion"


@pytest.mark.parametrize(
    ("scene", "pairs", "says"),
    [
        ("double_pendulum", [("A.angle", "B.angle")], "A.angle and B.angle are exchanged"),
        ("spinning_rod", [("A.angle", "rod.position.y")], "rod.position.y and A.angle are exchanged"),
        ("double_pendulum", UPPER_AND_LOWER, BODIES),
    ],
    ids=["joints", "quantities", "bodies"],
)
def test_explanation_of_exchanged_columns_names_both(scene, pairs, says):
    """Columns of the exact motion are exchanged between joints, quantities or bodies. Exchanged back, less
    than 1e-9 of the difference remains, the judge's own error."""
    (found,) = crosscheck.judge_motion(SCENES[scene](), exchanged_columns(scene, *pairs)).explanations
    assert found.sentence == says and found.remains < 1e-9


def lighter(body: str, factor: float) -> Callable[[Scene, Table], Table]:
    """Return the motion of the scene with a factor of the mass and inertia of a body."""

    def of(scene: Scene, _: Table) -> Table:
        one = scene.body[scene.body_index(body)]
        lighter = scene.with_(f"body[{body}].mass", factor * one.mass)
        return motion(lighter.with_(f"body[{body}].inertia", (factor * np.array(one.inertia)).tolist()))

    return of


def both(*pair: Callable[[Scene, Table], Table]) -> Callable[[Scene, Table], Table]:
    """Return the change of a table by two changes, one after the other."""
    return lambda scene, table: pair[1](scene, pair[0](scene, table))


DAMPED = [TorsionSpring(joint="B", stiffness=0.0, damping=0.02)]
TIED = {"bodies": ("ground", "lower"), "points": ((1.0, 0.5, 0.2), (0.9, 0.1, 0.0))}
SPRUNG = Spring(**TIED, stiffness=30.0, natural_length=0.3)  # without a spring only ratios of masses matter
MM, DEGREES = EVERYWHERE["mm"][0], EVERYWHERE["degrees"][0]
POINT = both(EVERYWHERE["another point"][0], lambda _, t: {n: t[n] for n in t if "velocity" not in n})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("load", "change", "says"),
    [
        ([], changed("load", DAMPED), ["damping of 0.02 N m s/rad in joint 'B'"]),
        ([SPRUNG], lighter("lower", 0.9), ["mass and inertia of body 'lower' times 0.9"]),
        ([SPRUNG], lighter("upper", 1e-3), ["body 'upper' has no mass"]),
        ([], both(MM, DEGREES), ["position: in mm, not m", "angle: in degrees, not rad"]),
        ([], both(POINT, MM), ["position: in mm, not m", "lower: a point at (100, 200, "]),
    ],
    ids=["damping", "mass", "missing body", "millimetres and degrees", "millimetres and point"],
)
def test_first_explanation_names_a_load_a_mass_or_both_of_two_changes(load, change, says):
    """The recorded motion is of a changed double pendulum, or has two changes. With the changes that the
    sentence names, less than 1e-3 of the difference between recorded motion and reference remains."""
    scene = double_pendulum().with_(load=load)
    (first, *_) = crosscheck.judge_motion(scene, change(scene, motion(scene))).explanations
    assert all(sentence in first.sentence for sentence in says), first.sentence
    assert first.remains < 1e-3


def test_damping_that_a_table_leaves_out_is_named_as_its_only_cause() -> None:
    """A wheel of 16 rad/s with a damper for 0.2 s; the table has the angle and rate of the free wheel."""
    free = spinning_rod().with_(duration=0.2)
    times = np.linspace(0.0, free.duration, 9)
    table = {n: c for n, c in motion(free, times).items() if n in ("time", "A.angle", "A.rate")}
    damped = free.with_(load=[TorsionSpring(joint="A", stiffness=0.0, damping=0.15)])
    (found,) = crosscheck.judge_motion(damped, table).explanations
    assert found.sentence == "without the damping of load(0)" and found.remains < FITTED


def test_each_number_of_a_scene_is_tried_as_a_cause() -> None:
    """``changes`` has one change for each number; here each is told to change its number by -1 times itself,
    which leaves it out, and a switch to act 1 s, the duration, earlier."""
    scene = switched_motor().with_(load=[*switched_motor().load, *damped_pendulum().load])
    assert {change.says(-1.0) for change in changes(scene)} == {
        "gravity of 0 m/s², not 9.81",
        "without the torque of load(0)",
        *(f"load(0) is switched {way} later by -1 s" for way in ("on", "off", "on and off")),
        "without the stiffness of load(1)",
        "without the damping of load(1)",
        "without the armature of joint 'A'",
        "body 'rod' has no mass",
    }


def test_search_for_a_cause_ends_when_the_clock_of_its_thread_has_gone_20_s(monkeypatch) -> None:
    """The clock is replaced by one that goes a second at each reading. The search reads it before each of
    hundreds of causes, and so ends after 20; the reference, without a limit here, reads it a few tens of
    times. With the real clock the search is complete."""
    table, clock = drifting(SCENES["spinning_rod"](), known("spinning_rod")), itertools.count()
    few = {n: table[n] for n in ("time", "A.angle")}
    assert crosscheck.judge_motion(spinning_rod(), few).is_complete
    monkeypatch.setattr(time, "thread_time", lambda: float(next(clock)))
    found = crosscheck.judge_motion(spinning_rod(), few, seconds=1e9)
    assert not found.is_complete and 20 < next(clock) < 100
