"""Parts of the conformance suite / last digits, hints, reduced scenes and tables worked out by hand."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.text import Text

from crosscheck.conformance import deep_table, findings, hint, precise, suite
from crosscheck.conformance.runners import InProcess, _OutOfTime, _within
from crosscheck.conformance.trial import NEIGHBOURS, Broken, Outside
from crosscheck.engine import Setting
from crosscheck.judge import precision, push_difference
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.tolerances import GRAINS
from mbref.scene import Body, Driver, Force, Moment, Revolute, Scene, SceneError
from mbref.trajectory import Cost, Outcome, Trajectory

Z, O = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
WHEEL = Body(
    name="wheel", mass=3.0, inertia=(1.0, 1.5, 2.0), position=(4.0, 0.0, 0.0), velocity=(0.0, 8.0, 0.0)
)
HINGE = Revolute(name="A", bodies=("ground", "wheel"), anchor=O, axis=Z)
SCENE = Scene(name="turning", body=(WHEEL,), joint=(HINGE,), duration=0.5, gravity=(0.0, -10.0, 0.0))
LENGTH = scene_length(SCENE)


def motion(samples: int = 3, **parts: Any) -> Trajectory:
    """4 m from the axis at 8 m/s and 2 rad/s, all samples alike."""
    zero = np.zeros((samples, 1, 3))
    made = {
        "position": zero + np.array([4.0, 0.0, 0.0]),
        "orientation": np.tile([1.0, 0.0, 0.0, 0.0], (samples, 1, 1)),
        "velocity": zero + np.array([0.0, 8.0, 0.0]),
        "angular_velocity": zero + np.array([0.0, 0.0, 2.0]),
        "acceleration": zero + np.array([-16.0, 0.0, 0.0]),
        "angular_acceleration": zero.copy(),
        "reactions": {"A": np.tile([-48.0, 30.0, 0.0, 0.0, 0.0, 0.0], (samples, 1))},
        **parts,
    }
    return Trajectory("turning", "e", "1", "m", {}, 0.1 * np.arange(samples), ("wheel",), **made)


def moved(name: str, by: Any, samples: int = 3) -> Trajectory:
    run = motion(samples)
    array = getattr(run, name).copy()
    array[-1, 0] += by
    return replace(run, **{name: array})


# --- last digits ------------------------------------------------------------------------------------------
def test_the_rate_of_a_motion():
    """8 m/s over the scene's length, 2 rad/s, or one over the duration of 0.5 s."""
    assert precision.motion_rate(SCENE, motion()) == pytest.approx(max(8 / LENGTH, 2.0))
    slow = motion(velocity=np.zeros((3, 1, 3)), angular_velocity=np.zeros((3, 1, 3)))
    assert precision.motion_rate(SCENE, slow) == 2.0
    assert precision.motion_rate(SCENE, moved("angular_velocity", (0.0, 0.0, 7.0))) == 9.0


def test_noise_is_what_sixth_differences_leave():
    """A motion of fifth order has none; one sample that is off by 1e-6 of the length leaves 20e-6 / √924."""
    t = np.arange(9.0)
    place = (1e-3 * t**5 - t)[:, None, None] * np.array([1.0, 0.0, 0.0])
    assert precision._noise(place) < 1e-12
    place[4, 0, 0] += 1e-6
    assert precision._noise(place) == pytest.approx(20e-6 / math.sqrt(924), rel=1e-4)
    noisy = motion(9)
    noisy.position[4, 0, 1] += 1e-6 * LENGTH
    assert precision.grain(SCENE, noisy) == (pytest.approx(20e-6 / math.sqrt(924)), "positions")
    flipped = motion(9)
    flipped.orientation[5:] *= -1
    assert precision.grain(SCENE, flipped)[0] == 0.0, "a quaternion's sign has no meaning"
    spinning = motion(9)
    spinning.angular_velocity[4, 0, 2] += 2e-6
    rate = precision.motion_rate(SCENE, spinning)
    assert precision.grain(SCENE, spinning) == (
        pytest.approx(40e-6 / math.sqrt(924) / rate),
        "angular velocities",
    )


@pytest.mark.parametrize(("kind", "is_single"), [(np.float32, True), (np.float64, False)])
def test_numbers_of_single_precision(kind, is_single):
    rng = np.random.default_rng(1)
    run = motion(6)
    run.velocity[:] = rng.normal(size=run.velocity.shape).astype(kind)
    found = precision.single_precision(SCENE, run)
    assert found == (["velocity of wheel"] if is_single else [])
    run.reactions["A"][:] = rng.normal(size=(6, 6)).astype(kind)
    assert ("reaction in A" in precision.single_precision(SCENE, run)) is is_single


def test_constant_and_few_numbers_are_no_evidence():
    """Four numbers are needed; halves and eighths do not count."""
    thirds = np.float32(1 / 3) * np.array([1, 2, 4, 5, 7, 8, 10, 11])
    for count, is_single in ((3, False), (4, True)):
        series = (
            np.concatenate([thirds[:count], np.full(8 - count, 0.5)])
            .astype(np.float32)
            .astype(float)[:, None]
        )
        assert precision._is_single(series, series) is is_single
    assert not precision._is_single(np.full((9, 1), 1 / 3), np.full((9, 1), 1 / 3))
    tiny = 2.0**-12 * thirds.astype(float)[:, None] / 3
    assert not precision._is_single(tiny, tiny), "small numbers may have lost bits"


def test_arrays_that_are_not_finite():
    assert precision.not_finite(motion()) == []
    bad = moved("velocity", np.nan)
    bad.reactions["A"][0, 0] = np.inf
    assert precision.not_finite(bad) == ["velocity", "reaction in A"]
    assert precision.not_finite(motion(acceleration=None, reactions=None)) == []


def bench(**parts: Any) -> SimpleNamespace:
    made = {
        "scene": SCENE,
        "motion": motion(),
        "exact": motion(),
        "close": motion(9),
        "rounding": 1e-16,
        "settings": ["a", "b"],
        "sweep": [motion(), motion()],
        "perturbed": motion(),
        "own_pushes": 1e-3,
        "steps_apart": 3e-8,
        "steps_before": 5e-7,
    }
    return SimpleNamespace(**{**made, **parts})


def test_checks_of_last_digits():
    assert precise.double_precision(bench()) == (0.0, 0.0, "")
    outside = precise.double_precision(bench(rounding=1e-7))
    assert isinstance(outside, Outside) and "rounded to 1.0e-07" in outside.reason
    assert precise.smooth(bench()) == (0.0, 1e-9, precise.smooth(bench()).remark)
    assert precise.smooth(bench(rounding=1e-7)).allowed == pytest.approx(16e-7)


@pytest.mark.parametrize(
    ("parts", "allowed"),
    [({}, 5e-7), ({"steps_before": 1e-12}, 1e-9), ({"rounding": 1e-7}, 16e-7)],
)
def test_differences_of_successive_settings(parts, allowed):
    found = precise.refined(bench(sweep=[0, 0, 0], **parts))
    assert found.measured == 3e-8 and found.allowed == pytest.approx(allowed)
    assert found.remark == f"{bench(**parts).steps_before:.1e} apart before"
    assert isinstance(precise.refined(bench(sweep=[0, 0])), Outside)


def test_the_worst_quantity_of_a_settled_run():
    """Velocities are off by 1e-6 of the length and rate, and accelerations by 2e-3 of 16 m/s²."""

    def alone(name: str, by: Any) -> Trajectory:
        return replace(moved(name, by), reactions={})

    rate = precision.motion_rate(SCENE, motion())
    off = alone("velocity", (1e-6 * LENGTH * rate, 0.0, 0.0))
    alike = {"motion": off, "sweep": [off, off], "perturbed": off}
    assert precise.settled(bench(**alike)) == (pytest.approx(1e-6), 1e-9, "velocities")
    near = alone("velocity", (4e-6 * LENGTH * rate, 0.0, 0.0))
    swept = precise.settled(bench(**{**alike, "sweep": [off, near]}))
    assert swept.allowed == pytest.approx(4 * 3e-6), "four times the difference of settings"
    assert precise.settled(bench(**{**alike, "perturbed": near})).allowed == pytest.approx(100 * 3e-6)
    pushed = precise.settled(bench(motion=alone("acceleration", (0.032, 0.0, 0.0))))
    assert pushed.measured == pytest.approx(2e-3) and pushed.allowed == 1e-3
    for parts, says in (
        ({"settings": ["a"]}, "one setting"),
        ({"exact": moved("velocity", np.nan)}, "poses only"),
    ):
        outside = precise.settled(bench(**parts))
        assert isinstance(outside, Outside) and says in outside.reason


def test_quantities_that_are_compared():
    names = ["velocities", "accelerations", "balance of reactions", "reactions along freedoms"]
    assert [f.remark for f in precise._rates(bench())] == names
    assert [f.remark for f in precise._rates(bench(motion=motion(reactions={})))] == names[:2]
    assert [f.remark for f in precise._rates(bench(exact=motion(acceleration=None)))] == names[:1]


def test_motions_that_are_compared(monkeypatch):
    """The run gives the reactions; the exact motion gives the forces that the reactions must exert."""
    given, asked = bench(), []
    names = {id(given.scene): "scene", id(given.motion): "run", id(given.exact): "exact"}
    for function in ("accelerations_apart", "balance", "idle"):
        monkeypatch.setattr(
            precise, function, lambda *of, name=function: asked.append([name, *(names[id(o)] for o in of)])
        )
    found = list(precise._rates(given))
    assert asked == [
        ["accelerations_apart", "scene", "exact", "run"],
        ["balance", "scene", "run", "exact"],
        ["idle", "scene", "run", "exact"],
    ]
    assert [f.allowed for f in found[1:]] == [1e-3] * 3


def test_differences_of_accelerations_and_reactions():
    """0.16 of 16 m/s²; an angular acceleration counts times the length; 4.8 N of the reaction."""
    apart = push_difference.accelerations_apart
    assert apart(SCENE, motion(), moved("acceleration", (0.16, 0.0, 0.0))) == pytest.approx(
        0.16 / max(16, LENGTH / 0.25)
    )
    scale = max(16.0, LENGTH / 0.25)
    assert apart(SCENE, motion(), moved("angular_acceleration", Z)) == pytest.approx(LENGTH / scale)
    assert apart(SCENE, motion(acceleration=None), moved("angular_acceleration", Z)) == pytest.approx(
        LENGTH / (LENGTH / 0.25)
    )
    assert apart(SCENE, motion(acceleration=None, angular_acceleration=None), motion()) == 0.0
    other = motion()
    other.reactions["A"][-1, 0] += 4.8
    size = math.hypot(48.0, 30.0)
    assert push_difference.pushes_apart(SCENE, motion(), other) == (pytest.approx(4.8 / size), "reactions")
    twisted = motion()
    twisted.reactions["A"][-1, 3] += LENGTH
    assert push_difference.pushes_apart(SCENE, motion(), twisted)[0] == pytest.approx(1.0 / size)
    assert push_difference.pushes_apart(SCENE, motion(reactions=None), other) == (0.0, "reactions")


# --- hints ------------------------------------------------------------------------------------------------
def test_accelerations_by_differences_of_order_8():
    """A velocity t⁸ / 8 has the derivative t⁷; the angular one counts times the length."""
    step = 0.25
    t = 1.0 + step * np.arange(-NEIGHBOURS, NEIGHBOURS + 1)
    run = motion(9)
    run = replace(run, times=t)
    run.velocity[:, 0, 0], run.angular_velocity[:, 0, 2] = t**8 / 8, 3 * t
    found = hint._differences(SCENE, SimpleNamespace(close=run))
    assert found == pytest.approx([1.0, 0.0, 0.0, 0.0, 0.0, 3 * LENGTH], abs=1e-11)
    assert hint._least(SCENE) == LENGTH / 0.25


def test_rounding_of_velocities_over_the_step_is_no_acceleration():
    """3 m/s and 4 m/s of turning, rounded to 2⁻²³ and 16 grains, over a quarter of a second."""
    run = replace(motion(9), times=1.0 + 0.25 * np.arange(9))
    run.velocity[NEIGHBOURS, 0], run.angular_velocity[NEIGHBOURS, 0] = (3.0, 0.0, 0.0), (0.0, 0.0, 4 / LENGTH)
    bench = SimpleNamespace(scene=SCENE, close=run, rounding=2.0**-23)
    assert hint._rounded(bench) == pytest.approx(16 * 2.0**-23 * 5.0 / 0.25, rel=1e-12)


def test_parts_that_a_scene_needs():
    assert hint.parts_of(SCENE) == ["mass matrix", "gravity", "velocity terms", "constraints"]
    free = Scene(name="free", body=(WHEEL.model_copy(update={"velocity": None}),), gravity=O)
    assert hint.parts_of(free) == ["mass matrix"]
    loaded = free.with_(load=(Moment(body="wheel", moment=Z),), joint=(HINGE,))
    assert hint.parts_of(loaded) == ["mass matrix", "loads", "constraints"]
    assert (
        hint.parts_of(loaded.with_(driver=(Driver(joint="A", polynomial=(0.0, 0.0, 1.0)),)))[-1] == "drivers"
    )


def failure(name: str, check: str = "truth", **parts: Any) -> hint.Failure:
    return hint.Failure(SimpleNamespace(scene=SCENE.with_(name=name, **parts)), check)


def hinted(monkeypatch: pytest.MonkeyPatch, *failures: hint.Failure, **changes: Any) -> str:
    def explained(runner: Any, asked: hint.Failure, family: str) -> Any:
        found = changes[asked.specimen.scene.name]
        return [] if found == "broken" else [(asked, found)]

    monkeypatch.setattr(hint, "_looked_at", explained)
    return hint.hint(None, failures)


def test_hints(monkeypatch):
    """The scene with the fewest parts comes first; the change that explains most scenes is named."""
    few, many = failure("few", "energy", gravity=O), failure("many")
    gravity, loads, velocity = ("gravity", "g off"), ("loads", "no load"), ("velocity terms", "none")
    begin = (
        "hint: begin with the scene 'few', check energy (it needs: mass matrix, velocity terms, constraints)"
    )
    assert hinted(monkeypatch, many, few, few={loads, gravity}, many={gravity}) == (
        f"{begin}; look at the gravity: g off explains 2 of 2 scenes with wrong accelerations"
    )
    assert hinted(monkeypatch, many, few, few={velocity, gravity}, many=None) == (
        f"{begin}; look at the gravity: g off explains 1 of 1 scenes with wrong accelerations"
    ), "of equal counts the part that other parts depend on"
    assert hinted(monkeypatch, many, few, few=None, many=None) == (
        f"{begin}; accelerations agree with the judge's, so look at the integration or at the output"
    )
    assert hinted(monkeypatch, many, few, few=set(), many=None) == (
        f"{begin}; its accelerations are wrong, and no single term explains them"
    )
    assert hinted(monkeypatch, many, few, few=None, many={gravity}).startswith(
        "hint: begin with the scene 'many', check truth"
    ), "a scene with wrong accelerations comes before a scene with right ones"
    assert hinted(monkeypatch, many, many="broken") == "" == hinted(monkeypatch)


def test_eight_scenes_with_masses_are_examined(monkeypatch):
    asked: list[str] = []
    monkeypatch.setattr(
        hint, "_looked_at", lambda runner, f, family: asked.append(f.specimen.scene.name) or []
    )
    without = failure("none", body=(Body(name="wheel", position=WHEEL.position),))
    assert hint.hint(None, [without, *(failure(f"s{k}") for k in range(9))]) == ""
    assert asked == [f"s{k}" for k in range(8)]


def test_which_changes_explain_an_acceleration(monkeypatch):
    """Right: 1 m/s²; the engine has 1.1; changes that leave 2 % of the difference of 0.1 explain it."""
    still = motion(9)
    monkeypatch.setattr(hint, "terms_at", lambda scene, run, k: np.array([1.0]))
    monkeypatch.setattr(hint, "accelerations", lambda scene, terms: terms)
    monkeypatch.setattr(hint, "_least", lambda scene: 0.5)
    changed = {"near": 1.0981, "far": 1.0979}
    monkeypatch.setattr(
        hint, "variants", lambda *_: [("loads", name, np.array([x])) for name, x in changed.items()]
    )

    def found(own: float) -> Any:
        monkeypatch.setattr(hint, "_differences", lambda scene, bench: np.array([own]))
        return hint.explanations(SimpleNamespace(scene=SCENE, close=still, rounding=rounding))

    rounding = 0.0
    assert found(1.1) == {("loads", "near")}
    assert found(1.00099) is None and found(1.00101) == set(), "1e-3 of the acceleration"
    with pytest.raises(Broken, match="are not known"):
        found(math.nan)
    speed, step = math.hypot(8.0, 2.0 * scene_length(SCENE)), 0.1
    rounding = 1e-3 * step / (GRAINS * speed)  # changes velocities in a step by 1e-3 of it
    assert found(1.00199) is None and found(1.00201) == set(), "and as much by rounding"


# --- reduced scenes ---------------------------------------------------------------------------------------
def two(**parts: Any) -> Scene:
    other = WHEEL.model_copy(
        update={"name": "rod", "position": (6.0, 0.0, 0.0), "velocity": (1.26, 0.0, 0.0)}
    )
    pin = Revolute(name="B", bodies=("wheel", "rod"), anchor=(5.0, 0.0, 0.0), axis=Z)
    made = {
        "body": (WHEEL, other),
        "joint": (HINGE, pin),
        "load": (Moment(body="wheel", moment=Z), Force(body="rod", point=O, force=Z)),
        "driver": (Driver(joint="A", polynomial=(0.0, 2.0)),),
        **parts,
    }
    return SCENE.with_(**made)


def test_smaller_scenes():
    """Without each body with its joints, drivers and loads; without each item; simpler numbers."""
    found = list(findings._smaller(two()))
    assert [b.name for b in found[0].body] == ["rod"]
    assert not found[0].joint and not found[0].driver and [load.type for load in found[0].load] == ["force"]
    assert [b.name for b in found[1].body] == ["wheel"] and [j.name for j in found[1].joint] == ["A"]
    assert [load.type for load in found[1].load] == ["moment"] and len(found[1].driver) == 1
    counts = [(len(s.load), len(s.driver), len(s.joint)) for s in found[2:]]
    assert counts[:4] == [(1, 1, 2), (1, 1, 2), (2, 0, 2), (2, 1, 1)], "a driven joint is not removed"
    simpler = found[6:]
    assert simpler[0].gravity == O and simpler[1].body[0].velocity is None
    assert simpler[2].duration == 0.25 and simpler[3].body[1].velocity == (1.3, 0.0, 0.0)
    assert len(simpler) == 4, "two digits change nothing"


def test_a_violation_is_reduced_while_it_is_there():
    """It needs the wheel and gravity: all else is removed."""
    small = findings.shrunk(two(), lambda s: any(b.name == "wheel" for b in s.body) and any(s.gravity))
    assert (
        [b.name for b in small.body] == ["wheel"] and not small.joint and not small.load and not small.driver
    )
    assert small.gravity == SCENE.gravity and small.body[0].velocity is None
    assert findings.shrunk(two(), lambda s: False) == two()
    tried: list[Scene] = []
    findings.shrunk(two(), lambda s: tried.append(s) or False, 5)
    assert len(tried) == 5
    tried.clear()
    findings.shrunk(two(), lambda s: tried.append(s) or True)
    assert len(tried) <= 60


def test_a_violation_is_a_file_with_the_command_that_repeats_it(tmp_path):
    verdict = suite.Verdict("truth", "turning", suite.FAIL, 0.25, 1e-3, "it is off")
    path = findings.keep(SCENE, verdict, "a:b", tmp_path / "new")
    first, second, *rest = path.read_text().splitlines()
    assert path.name == "a_b_truth_turning.toml"
    assert first == f"# a:b: {verdict.check()} fails 0.25, allowed 0.001 it is off"
    assert second == f"# crosscheck verify a:b --scene {path}"
    assert Scene.from_file(path) == SCENE and rest
    named = findings.keep(SCENE, replace(verdict, measured=None, reason=""), "e", tmp_path, "dead end")
    first, second, *_ = named.read_text().splitlines()
    assert first == f"# e: {verdict.check()} fails" and second == "# crosscheck verify e --scene 'dead end'"


# --- tables -----------------------------------------------------------------------------------------------
def tally(**parts: Any) -> SimpleNamespace:
    made = {
        "plan": SimpleNamespace(engine="e", family="f", first=3),
        "version": "1.2",
        "seeds": 5,
        "counts": {"truth": Counter({suite.PASS: 4, suite.FAIL: 1}), "closure": Counter({suite.PASS: 5})},
        "worst": {"truth": (2.5, "random 4")},
        "violations": [
            {"scene": "random 4", "check": "truth", "measured": 0.5, "allowed": 0.2, "reason": "it is off"},
            {"scene": "random 5", "check": "closure", "measured": None, "allowed": None, "reason": ""},
        ],
        "decided": lambda status: 4,
        **parts,
    }
    return SimpleNamespace(**made)


def test_the_table_of_random_mechanisms(monkeypatch):
    monkeypatch.setattr(deep_table, "check_of", lambda name: name.upper())
    monkeypatch.setattr(deep_table, "about", lambda name: f"about {name}")
    table, first, second, summary = deep_table.tables(tally())
    assert table.title == "e 1.2 f: random mechanisms, seeds 3 to 7"
    rows = list(zip(*(column.cells for column in table.columns), strict=True))
    assert rows == [
        ("TRUTH", "4", "1", "0", "0", "2e+00 random 4", "about truth"),
        ("CLOSURE", "5", "0", "0", "0", "", "about closure"),
    ]
    assert isinstance(first, Text) and first.plain == "fail: random 4, truth: 0.5, allowed 0.2 it is off"
    assert second.plain == "fail: random 5, closure:"
    assert summary.plain == "e: 2 violated checks; the engine ran 4 of 5 random mechanisms"
    *_, none = deep_table.tables(tally(violations=[], decided=lambda status: 0))
    assert none.plain == "e: ran none of 5 random mechanisms, so it is not judged"


# --- runs in this process ---------------------------------------------------------------------------------
class Paper:
    """An engine on paper."""

    name, package, rounding, compile_seconds = "paper", "p", 1e-15, 0.25

    def __init__(self, act: Any = None) -> None:
        self.act, self.prepared = act, []

    def version(self) -> str:
        return "1"

    def prepare(self, families: Any) -> None:
        self.prepared.append(families)

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        if self.act:
            self.act()
        made = motion(len(times))
        return replace(made, engine="paper", times=times, t_end=float(times[-1]), cost=Cost(0.1))


TIMES = np.array([0.0, 0.1])


def spin() -> None:
    while True:
        pass


def test_a_run_in_this_process_and_what_it_leaves():
    def act() -> None:
        print("hello")
        with open("made.txt", "w") as file:
            file.write("x")

    engine = Paper(act)
    seen = InProcess(engine).observe(SCENE, TIMES, Setting("m"))
    assert seen.value.outcome is Outcome.COMPLETED and (seen.printed, seen.files) == (
        "hello\n",
        ("made.txt",),
    )
    assert engine.prepared == [], "without a limit nothing is prepared"
    assert InProcess(engine).name == "paper" and InProcess(engine, "m:E").name == "m:E"
    assert InProcess(engine).rounding == 1e-15


def test_a_run_in_this_process_that_fails_or_takes_too_long():
    def fails() -> None:
        raise ValueError("no pose")

    failed = InProcess(Paper(fails), "m:E").observe(SCENE, TIMES, Setting("m")).value
    assert (failed.outcome, failed.message, failed.engine) == (Outcome.CRASHED, "ValueError: no pose", "m:E")
    late = Paper(spin)
    late.compile_seconds = 0.02
    ended = InProcess(late, time_limit=0.03).observe(SCENE, TIMES, Setting("m")).value
    assert (ended.outcome, ended.message) == (Outcome.TIMED_OUT, "no result after 0.05 s")
    assert late.prepared == [["m"]]
    with pytest.raises(_OutOfTime), _within(0.01):
        spin()
    with _within(math.inf):
        pass


def test_runs_in_this_process_follow_each_other():
    first, second = InProcess(Paper()).in_turn([(SCENE, Setting("m")), (SCENE, Setting("n"))], TIMES)
    assert first.outcome is second.outcome is Outcome.COMPLETED


def test_scenes_that_are_no_scenes_are_not_tried():
    joint_of_nothing = two().with_(load=())
    assert all(isinstance(s, Scene) for s in findings._smaller(joint_of_nothing))
    with pytest.raises(SceneError):
        joint_of_nothing.with_(joint=joint_of_nothing.joint[1:])
