"""Stability ladders and quick sweeps / difficulties, sizes and rates of their scenes worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.study import least_errors, stability, sweep
from crosscheck.study.grid import Case
from mbref.scenes import SCENES

LADDERS = {ladder.name: ladder for ladder in stability.ladders()}
ENDS = {  # easiest and hardest difficulty, and the number of rungs
    "start": (1e-1, 1e-14, 9),
    "turning_back": (1e-1, 1e-9, 9),
    "gap": (1e-1, 1e-13, 9),
    "mass_ratio": (1.0, 1e12, 9),
    "length_ratio": (1.5, 1e6, 7),
    "units": (1e-6, 1e4, 9),
    "speed": (1e-6, 1e7, 9),
    "stiffness": (1.0, 1e12, 9),
    "tilt": (1e-1, 1e-15, 8),
    "initial_violation": (1e-14, 1e-2, 9),
    "rank_tolerance": (1e-16, 1e-1, 9),
    "duration": (0.3, 1e3, 8),
}


def rungs(name: str) -> dict:
    return dict(LADDERS[name].rungs)


def crank_angle(scene) -> float:
    """The angle of the crank from its quaternion."""
    w, *_, z = scene.body[0].orientation
    return 2 * math.atan2(z, w)


def test_difficulties_from_easy_to_hard():
    found = {n: (lad.rungs[0][0], lad.rungs[-1][0], len(lad.rungs)) for n, lad in LADDERS.items()}
    assert found == ENDS
    assert all(ladder.words.endswith(".") and ladder.label for ladder in LADDERS.values())
    assert list(stability.powers(0, 2, 3)) == [1.0, 10.0, 100.0]
    assert list(stability.powers(-1, 1, 5)) == [0.1, 0.3, 1.0, 3.0, 10.0], "one digit"
    assert stability.place(stability.scene_name("gap", 1e-5)) == ("gap", 1e-5)
    names = [scene.name for scene in stability.scenes()]
    assert names[0] == "start[0.1]" and len(set(names)) == len(names) == sum(n for *_, n in ENDS.values())


def test_rhombi():
    start, back = rungs("start")[0.1], rungs("turning_back")[0.1]
    assert crank_angle(start) == pytest.approx(math.pi + 0.1) and start.duration == 0.05
    assert start.driver[0].polynomial == (0.0, -124.8)
    assert crank_angle(back) == pytest.approx(-0.1) and back.duration == 1.5 and back.gravity == (0, -9.81, 0)
    for rate in (1e-6, 1e7):
        driven = rungs("speed")[rate]
        assert driven.driver[0].polynomial == (0.0, -rate) and crank_angle(driven) == pytest.approx(
            math.pi / 2
        )
        assert driven.duration == pytest.approx(4 * math.pi / rate), "two turns"
        spins = [body.angular_velocity for body in driven.body]
        assert np.allclose(spins, [(0, 0, -rate), (0, 0, 0), (0, 0, -rate)], rtol=1e-12)


def sizes(scene) -> tuple[float, float]:
    """Lengths of crank and rod, from the places of the joints A, B and C."""
    a, b, c = (np.array(joint.anchor_pair[0]) for joint in scene.joint[:3])
    return float(np.linalg.norm(b - a)), float(np.linalg.norm(c - b))


def test_slider_cranks_at_30_rad_per_s():
    gap, heavy = rungs("gap")[1e-1], rungs("mass_ratio")[1e12]
    assert sizes(gap) == pytest.approx((0.308, 0.408)) and gap.duration == 0.25 and not any(gap.gravity)
    assert sizes(heavy) == pytest.approx((0.304, 0.4048)) and heavy.duration == 0.5
    assert heavy.body[2].mass == pytest.approx(0.304e12) and heavy.body[0].mass == pytest.approx(0.304)
    assert heavy.body[2].inertia == pytest.approx((0.304e10,) * 3)
    for ratio in (1.5, 1e6):
        long = rungs("length_ratio")[ratio]
        assert sizes(long) == pytest.approx((0.4 / ratio, 0.4)) and long.duration == 0.5
    turning = rungs("duration")[10.0]
    assert turning.duration == 10.0 and turning.gravity == (0, -9.81, 0)
    assert rungs("rank_tolerance")[1e-1].duration == 0.5
    for scene in (gap, heavy, long, turning):
        assert crank_angle(scene) == pytest.approx(0.3) and scene.body[0].angular_velocity == (0, 0, 30)


def test_another_unit_of_length_keeps_the_motion_similar():
    """Lengths by u, times by √u, rates by 1/√u, masses as before, moments of inertia by u²."""
    plain = rungs("duration")[0.3]
    for unit in (1e-6, 1e4):
        scene = rungs("units")[unit]
        assert sizes(scene) == pytest.approx((0.304 * unit, 0.4048 * unit))
        assert scene.duration == pytest.approx(0.5 * math.sqrt(unit)) and scene.gravity == (0, -9.81, 0)
        assert scene.body[0].angular_velocity == pytest.approx((0, 0, 30 / math.sqrt(unit)))
        for body, same in zip(scene.body, plain.body, strict=True):
            assert body.mass == same.mass and np.allclose(body.inertia, np.multiply(same.inertia, unit**2))


def test_spring_is_stretched_by_a_tenth_for_two_periods():
    for stiffness in (1.0, 1e12):
        scene = rungs("stiffness")[stiffness]
        [spring] = scene.load
        reach = 1.0 - scene.body[2].position[0]
        assert spring.stiffness == stiffness and spring.bodies == ("ground", "slider")
        assert spring.points == ((1.0, 0.0, 0.0), scene.body[2].position)
        assert spring.natural_length == pytest.approx(0.9 * reach)
        assert scene.duration == pytest.approx(4 * math.pi / math.sqrt(stiffness))
        assert all(body.angular_velocity is None for body in scene.body) and sizes(scene)[0] == pytest.approx(
            0.304
        )


def test_door_and_its_tilted_hinge():
    scene = rungs("tilt")[1e-3]
    first, second = scene.joint
    assert (first.anchor, first.axis) == ((0, 0, 0), (0, 0, 1)) and second.axis == (1e-3, 0, 1)
    assert second.anchor == (0, 0, 1) and scene.gravity == (0, -9.81, 0) and scene.duration == 0.5
    [door] = scene.body
    assert (door.mass, door.inertia, door.position) == (1.0, (0.1, 0.2, 0.15), (0.5, 0.0, 0.5))


def test_given_velocities_miss_the_guide_by_a_fraction_of_the_pin_s_speed():
    """The pin moves at 0.304 · 30 m/s; only the slider's velocity along its guide is off."""
    small, large = rungs("initial_violation")[1e-14], rungs("initial_violation")[1e-2]
    off = np.subtract(*([body.velocity for body in scene.body] for scene in (large, small)))
    assert off[2] == pytest.approx([1e-2 * 0.304 * 30, 0.0, 0.0], rel=1e-9) and np.abs(off[:2]).max() < 1e-12
    assert large.duration == 0.5 and large.body[0].angular_velocity == pytest.approx((0, 0, 30))


def test_settings_of_a_rung(monkeypatch):
    offered = [Setting(f, {"step": h}) for f in ("tuned", "other") for h in (0.1, 0.01, 0.001)]
    monkeypatch.setattr(stability, "settings", lambda name, scene: offered)
    scene = SCENES["four_bar"]().with_(name="gap[0.1]", duration=1.0)
    *methods, (name, setting) = stability._settings(scene, ["pinocchio"])
    assert [m.family for _, m in methods] == list(stability.METHODS) and {e for e, _ in methods} == {"mbref"}
    assert {(m.options["rtol"], m.options["most_steps"]) for _, m in methods} == {(1e-9, 200_000)}
    assert (name, setting) == ("pinocchio", Setting("tuned", {"step": 0.01})), "the finest but one"
    monkeypatch.setattr(stability, "settings", lambda name, scene: offered[:1])
    assert list(stability._settings(scene, ["pinocchio"]))[-1][1].options["step"] == 0.1
    monkeypatch.setattr(stability, "settings", lambda name, scene: offered[3:])
    assert len(list(stability._settings(scene, ["pinocchio"]))) == len(stability.METHODS)
    swept = scene.with_(name="rank_tolerance[0.001]")
    found = list(stability._settings(swept, ["pinocchio"]))
    assert len(found) == len(stability.METHODS) and found[0][1].options["rank_tolerance"] == 1e-3
    for duration, steps in ((30.0, 200_000), (100.0, 600_000), (1000.0, 6_600_000)):
        assert stability._options(scene.with_(duration=duration))["most_steps"] == steps


def test_a_quick_sweep():
    assert {scene.name: scene.duration for scene in sweep.quick_scenes()} == {
        "planar_slider_crank": 0.2,
        "spatial_slider_crank": 0.02,
        "spatial_slider_crank_driven": 0.05,
        "four_bar": 0.05,
        "five_bar": 0.05,
    }
    assert [scene.name for scene in sweep.whole_scenes()] == list(SCENES)
    assert (sweep.QUICK_SAMPLES, sweep.SAMPLES, sweep.QUICK_LIMIT, sweep.LIMIT) == (31, 101, 5.0, 120.0)
    assert (sweep.LONG, sweep.QUICK_LONG) == (0.5, 0.05)
    assert (least_errors.FINEST, least_errors.TIME_LIMIT) == (3, 240.0)


def case(family: str, k: int, engine: str = "e") -> Case:
    return Case(SCENES["four_bar"](), np.array([0.0, 1.0]), engine, Setting(family, {"k": k}))


def test_few_families_and_few_settings():
    several = [case(f, k) for f in ("first", "tuned", "third", "defaults") for k in range(3)]
    others = [case(f, 0, "f") for f in ("p", "q", "r")]

    def names(found: list[Case]) -> list[str]:
        return list(dict.fromkeys(c.setting.family for c in found))

    assert names(sweep.of_few_families([*several, *others])) == ["tuned", "defaults", "p", "q"]
    assert names(sweep.of_few_families([*several, *others], ["third", "r"])) == ["third", "r"]
    assert len(sweep.of_few_families(several)) == 6
    long = [case("f", k) for k in range(8)]
    assert [c.setting.options["k"] for c in sweep.thinned([*long, case("g", 9)])] == [0, 4, 7, 9]
    assert [c.setting.options["k"] for c in sweep.spread(long, 4)] == [0, 2, 5, 7]
    assert sweep.spread(long[:2], 3) == long[:2]


def test_the_finest_settings_of_each_family_are_candidates(monkeypatch):
    cases = [SimpleNamespace(engine="e", setting=Setting(f, {"k": k})) for f in ("f", "g") for k in range(5)]
    monkeypatch.setattr(least_errors, "default_cases", lambda scene, engines, time_limit: (cases, []))
    found = least_errors.candidates(SCENES["four_bar"](), ["e"])
    assert [(c.setting.family, c.setting.options["k"]) for c in found] == [
        (f, k) for f in ("f", "g") for k in (2, 3, 4)
    ]


def test_rungs_of_every_ladder():
    """Powers of ten to one digit, from easy to hard."""
    found = {name: [difficulty for difficulty, _ in ladder.rungs] for name, ladder in LADDERS.items()}
    assert found["duration"] == [0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0]
    assert found["tilt"] == [1e-1, 1e-3, 1e-5, 1e-6, 1e-10, 1e-11, 1e-13, 1e-15]
    assert found["length_ratio"] == [1.5, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6]
    assert found["turning_back"] == [10.0**-k for k in range(1, 10)]
    assert found["mass_ratio"] == [1.0, 30.0, 1e3, 3e4, 1e6, 3e7, 1e9, 3e10, 1e12]
    assert all(scene.duration == d for d, scene in LADDERS["duration"].rungs)


def test_runs_of_every_rung(monkeypatch):
    monkeypatch.setattr(stability, "_settings", lambda scene, engines: [(engines[0], Setting("f"))])
    cases = stability.cases(["e"])
    assert [case.scene.name for case in cases] == [scene.name for scene in stability.scenes()]
    assert {(case.engine, case.time_limit, len(case.times)) for case in cases} == {("e", 20.0, 21)}
    assert all(case.times[0] == 0.0 and case.times[-1] == case.scene.duration for case in cases)


@pytest.mark.parametrize(("name", "count"), [("gap[0.1]", 1), ("rank_tolerance[0.1]", 0)])
def test_engines_have_no_rank_tolerance(monkeypatch, name, count):
    monkeypatch.setattr(stability, "settings", lambda engine, scene: [Setting("tuned", {"step": 0.1})])
    found = list(stability._settings(SCENES["four_bar"]().with_(name=name), ["exudyn"]))
    assert [engine for engine, _ in found] == ["mbref"] * len(stability.METHODS) + ["exudyn"] * count
