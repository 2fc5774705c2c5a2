"""Trials, distances, branches, films and warnings / direct cases at exact limits, worked out by hand."""

from __future__ import annotations

import math
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref import scene_slips
from mbref.design.turning import Turning
from mbref.drawing import film
from mbref.error_estimate import ErrorEstimate
from mbref.input_error import InputError
from mbref.scene import Body, Driver, Revolute, Scene, SceneError, TorsionSpring
from mbref.scene_bodies import UNIT_TOLERANCE
from mbref.scene_fields import checked_length, checked_mass, checked_size
from mbref.scene_function_faults import factor_faults, rows_of, table_faults
from mbref.scene_paths import replaced_at
from mbref.simulation import comparison, outcome, remedies, trial
from mbref.stepping.limits import Limits
from mbref.stepping.loop import DONE, UNDECIDED
from mbref.variation import Variation

ROD = Body(name="rod", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0))
HINGE = Revolute(name="A", bodies=("ground", "rod"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
SCENE = Scene(name="s", body=(ROD,), joint=(HINGE,))


# --- runs -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("passed", "status", "answer"),
    [(3, UNDECIDED, True), (2, UNDECIDED, False), (1, UNDECIDED, False), (2, DONE, True), (3, DONE, True)],
)
def test_a_run_passes_where_it_crosses_one_more_position_or_ends_otherwise(
    monkeypatch, passed, status, answer
):
    asked: list[Any] = []
    tried = SimpleNamespace(
        stepper=SimpleNamespace(advance=lambda progress: (status, 0.0)),
        crossings=[None] * passed,
        release=lambda: asked.append("released"),
    )
    monkeypatch.setattr(trial, "start_run", lambda *given: asked.append(given) or tried)
    run = undecided(2)
    assert trial.passes_with(run, rtol=1e-13, atol=None) is answer
    (scene, method, times, limits), released = asked
    assert (scene, method, times, released) == (run.scene, run.method, run.times, "released")
    assert limits == Limits(rtol=1e-13, violation=0.25, code="generic", most_steps=2000)


def undecided(crossings: int, steps: int = 2000, bodies: int = 100, is_series: bool = True) -> Any:
    system = SimpleNamespace(counts=SimpleNamespace(steps=steps))
    return SimpleNamespace(
        memory=SimpleNamespace(equations=SimpleNamespace(system=system)),
        method=SimpleNamespace(is_series=is_series),
        scene=SimpleNamespace(body=[None] * bodies),
        limits=Limits(violation=0.25),
        times="times",
        crossings=[None] * crossings,
    )


@pytest.mark.parametrize(
    ("parts", "answer"),
    [({}, False), ({"steps": 2001}, None), ({"bodies": 101}, None), ({"is_series": False}, None)],
)
def test_runs_of_many_steps_or_bodies_are_not_tried(monkeypatch, parts, answer):
    """A branch that does not exist passes nothing."""

    def refused(*given: Any) -> None:
        raise InputError("no branch")

    stepper = SimpleNamespace(advance=refused)
    monkeypatch.setattr(trial, "start_run", lambda *given: SimpleNamespace(stepper=stepper))
    assert trial.passes_with(undecided(0, **parts)) is answer


def test_distances_of_two_runs_at_their_first_samples():
    """Two bodies, 2 m: 5 m apart are 2.5, a half turn is pi; the fourth sample does not count."""
    at = np.zeros((4, 2, 7))
    at[:, :, 3] = 1.0
    other = at.copy()
    other[1, 1, :3] = 3.0, 0.0, 4.0
    other[2, 0, 3:] = 0.0, 0.0, 1.0, 0.0
    other[3] = 9.0

    def run(samples: np.ndarray) -> Any:
        loop = SimpleNamespace(samples=SimpleNamespace(coordinates=samples.reshape(4, 14)))
        return SimpleNamespace(memory=SimpleNamespace(loop=loop), model=SimpleNamespace(nb=2, length=2.0))

    assert comparison._distances(run(at), run(other), 3) == pytest.approx([0.0, 2.5, math.pi])


@pytest.mark.parametrize(
    ("free", "size", "name"),
    [
        ((0.6, 0.8), 0.0, "second"),
        ((0.8, 0.6), 0.0, "first"),
        ((0.8, 0.6), 0.99e-10, "first"),
        ((0.8, 0.6), 1.01e-10, ""),
    ],
)
def test_the_massless_body_that_moves_most_is_named(monkeypatch, free, size, name):
    """Both turn about their third axes together; the body with mass stays, whatever its columns are."""
    axis = np.zeros(12)
    axis[[5, 11]] = free
    rows = np.eye(12) - (1.0 - size) * np.outer(axis, axis)
    jacobian = np.hstack([rows[:, :6], np.full((12, 6), 7.0), rows[:, 6:]])
    monkeypatch.setattr(remedies, "scaled_jacobian", lambda model, t, q: {(0.0, "q"): jacobian}[t, q])
    bodies = [SimpleNamespace(name=n, mass=m) for n, m in (("first", 0.0), ("rod", 1.0), ("second", 0.0))]
    run: Any = SimpleNamespace(scene=SimpleNamespace(body=bodies), model=None, start=SimpleNamespace(q="q"))
    assert remedies._undetermined(run) == name


def test_branches_of_a_crossing_are_motions_of_the_bodies(monkeypatch):
    velocities = np.arange(36.0).reshape(3, 12)
    monkeypatch.setattr(outcome, "branches_passed", lambda model, passed: (velocities, "three branches"))

    def motion(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> dict[str, np.ndarray]:
        assert q.shape == (3, 2, 7) and v.shape == a.shape == (3, 2, 6) and not a.any()
        keys = ("position", "orientation", "velocity", "angular_velocity")
        return dict(zip(keys, (q[..., :3], q[..., 3:], v[..., :3], v[..., 3:]), strict=True))

    model: Any = SimpleNamespace(nb=2, motion=motion)
    passed: Any = SimpleNamespace(time=0.5, coordinates=np.arange(14.0), taken=2)
    found = outcome._with_branches_of(model, passed)
    assert (found.time, found.taken, found.sentence) == (0.5, 2, "three branches")
    assert found.position.tolist() == [[0, 1, 2], [7, 8, 9]]
    assert found.orientation.tolist() == [[3, 4, 5, 6], [10, 11, 12, 13]]
    assert found.velocity[1].tolist() == [[12, 13, 14], [18, 19, 20]]
    assert found.angular_velocity[2].tolist() == [[27, 28, 29], [33, 34, 35]]


@pytest.mark.parametrize(
    ("met", "projects", "count"), [(True, False, 1), (False, True, 2), (False, False, None)]
)
def test_crossings_that_a_motion_has(monkeypatch, met, projects, count):
    passed = [SimpleNamespace(time=t) for t in (1.0, 2.0)]
    monkeypatch.setattr(outcome, "lazy_crossings", lambda scene, given: (scene, given))
    run: Any = SimpleNamespace(
        scene="scene",
        crossings=passed,
        method=SimpleNamespace(stabilisation=SimpleNamespace(projects=projects)),
    )
    at: Any = SimpleNamespace(time=3.0, coordinates="q", velocities="v") if met else None
    found: Any = outcome._crossings(run, at)
    assert found is None if count is None else (found[0], len(found[1])) == ("scene", count)
    if met:
        assert found[1] == [(3.0, "q", "v", 0)]


# --- films ------------------------------------------------------------------------------------------------
def test_a_gif_has_the_duration_of_its_timeline(monkeypatch, tmp_path):
    """5 s for 3 images: 1.667 s each, in hundredths of a second."""
    saved: list[Any] = []

    class Saved(tuple[int, int]):
        def save(self, path: Any, **given: Any) -> None:
            saved.append((self, path, given))

    class Image:
        def __init__(self, number: int):
            self.number = number

        def quantize(self, colours: int) -> Saved:
            return Saved((self.number, colours))

    pillow = SimpleNamespace(Image=None)
    monkeypatch.setitem(sys.modules, "PIL", pillow)  # type: ignore[arg-type]
    monkeypatch.setitem(sys.modules, "PIL.Image", pillow)  # type: ignore[arg-type]
    asked: list[Any] = []
    monkeypatch.setattr(film, "_images", lambda *given: asked.append(given) or map(Image, range(3)))
    scene: Any = "scene"
    view: Any = "view"
    motion: Any = SimpleNamespace(times=np.array([0.0, 2.0, 5.0]))
    path = tmp_path / "film.gif"
    film.write_film(path, scene, motion, view)
    assert asked == [(scene, motion, view)]
    [(first, where, given)] = saved
    assert (first, where) == ((0, 64), path)
    assert given == {
        "save_all": True,
        "append_images": [(1, 64), (2, 64)],
        "duration": [1670.0, 1660.0, 1670.0],
        "loop": 0,
        "optimize": True,
    }


def test_an_mp4_has_the_images_of_its_timeline(monkeypatch, tmp_path):
    """3 samples within 5 s; images of 20 rows and 30 columns are sent as 32 rows and 32 columns."""
    sent: list[Any] = []
    made: list[Any] = []
    writer = SimpleNamespace(send=sent.append, close=lambda: sent.append("closed"))
    library = SimpleNamespace(write_frames=lambda *given, **named: made.append((given, named)) or writer)
    pillow = SimpleNamespace(Image=None)
    for name, module in (("imageio_ffmpeg", library), ("PIL", pillow), ("PIL.Image", pillow)):
        monkeypatch.setitem(sys.modules, name, module)  # type: ignore[arg-type]
    images = [np.full((20, 30, 3), k, dtype=np.uint8) for k in range(3)]
    monkeypatch.setattr(film, "_images", lambda *given: iter(images))
    nothing: Any = None
    motion: Any = SimpleNamespace(times=np.array([0.0, 2.0, 5.0]))
    film.write_film(tmp_path / "film.mp4", nothing, motion)
    assert made == [((str(tmp_path / "film.mp4"), (32, 32)), {"fps": 0.6, "macro_block_size": 16})]
    assert sent[0] is None and sent[-1] == "closed" and [each[0, 0, 0] for each in sent[1:-1]] == [0, 1, 2]
    assert all(each.shape == (32, 32, 3) and each.flags.c_contiguous for each in sent[1:-1])
    assert all((each[20:] == 255).all() and (each[:, 30:] == 255).all() for each in sent[1:-1])


def test_an_svg_is_the_animated_picture(monkeypatch, tmp_path):
    monkeypatch.setattr(film, "moving", lambda *given: f"{given} °")
    given: tuple[Any, ...] = ("scene", "motion", "view")
    film.write_film(tmp_path / "film.svg", *given)
    assert (tmp_path / "film.svg").read_text(encoding="utf-8") == f"{given} °"


# --- probable mistakes and limits of numbers --------------------------------------------------------------
def test_numbers_at_their_limits_are_no_mistakes():
    """Gravity of 100 m/s², a spring at a whole turn, and a driver that reaches 100 rad."""
    spring = TorsionSpring(joint="A", stiffness=1.0, natural_angle=math.tau)
    scene = SCENE.with_(gravity=(0.0, 60.0, 80.0), load=(spring,))
    assert not [*scene_slips._gravity(scene), *scene_slips._angles(scene)]
    driven = SCENE.with_(driver=(Driver(joint="A", polynomial=(0.0, 50.0)),), duration=2.0)
    assert not list(scene_slips._far_drivers(driven))
    [far] = scene_slips._far_drivers(driven.with_(duration=2.5))
    assert far == (
        "driver[A].polynomial: turns the joint by 125 rad, 19.9 turns, within 2.5 s; is it in degrees?"
    )


@pytest.mark.parametrize(("length", "said"), [(299.0, 0), (300.0, 1), (301.0, 1)])
def test_links_of_very_different_lengths(monkeypatch, length, said):
    links = {"rod": {"A–B": 1.0, "A–C": 0.0}, "bar": {"C–D": length}}
    monkeypatch.setattr(scene_slips, "link_lengths", lambda scene: links)
    found = list(scene_slips._lengths(SCENE))
    says = f"body[bar]: C–D is {length:g} m, A–B 1 m; is one in millimetres?"
    assert found == [says] * said


@pytest.mark.parametrize(("radius", "said"), [(30.0, 0), (30.1, 1)])
def test_inertias_of_bodies_larger_than_their_mechanism(radius, said):
    """A mechanism of 1 m; both a list of moments and a matrix of trace 2 m r²."""
    moment = 2.0 * radius**2 * 2.0 / 3.0
    for inertia in ((moment,) * 3, tuple(map(tuple, (moment * np.eye(3)).tolist()))):
        scene = SCENE.with_(body=(ROD.model_copy(update={"mass": 2.0, "inertia": inertia}),))
        found = list(scene_slips._inertias(scene))
        assert len(found) == said
        assert not said or found[0].startswith("body[rod].inertia: suits a body 30.1 m across")


@pytest.mark.parametrize(
    ("check", "good", "bad"),
    [
        (checked_size, (1e40, -1e40, 0.0), (1.01e40, -1.01e40)),
        (checked_length, (1e-40, 1e40), (0.99e-40, 1.01e40, 0.0)),
        (checked_mass, (0.0, 1e-40, 1e40), (0.99e-40, 1.01e40)),
    ],
)
def test_sizes_of_numbers(check, good, bad):
    assert [check(value) for value in good] == list(good)
    for value in bad:
        with pytest.raises(ValueError, match="in size, got"):
            check(value)


@pytest.mark.parametrize(
    ("rows", "start", "stop", "duration", "said"),
    [
        ([[0.5, 1.0], [2.0, 1.0]], 0.5, math.inf, 2.0, []),
        ([[0.5, 1.0], [2.0, 1.0]], 0.5, 2.0, 3.0, []),
        ([[0.5, 1.0], [1.0, 1.0]], 0.5, math.inf, None, []),
        ([[0.5, 1.0], [0.9, 1.0]], 0.5, math.inf, None, ["its last row is at 0.9 s, but it acts until 1 s"]),
        (
            [[0.5, 1.0], [2.0, 1.0]],
            0.4,
            math.inf,
            2.0,
            ["its first row is at 0.5 s, but it acts from 0.4 s on"],
        ),
        (
            [[0.5, 1.0], [2.0, 1.0]],
            0.0,
            9.0,
            3.0,
            [
                "its first row is at 0.5 s, but it acts from 0 s on",
                "its last row is at 2 s, but it acts until 3 s",
            ],
        ),
        ([[0.5, 1.0], [2.0, "1"]], 0.0, 9.0, 3.0, []),
    ],
)
def test_gaps_of_tables(rows, start, stop, duration, said):
    data = {} if duration is None else {"duration": duration}
    found = list(table_faults("p", {"table": rows}, data, start, stop))
    assert found == [("p", f"leaves a gap: {words}") for words in said]


@pytest.mark.parametrize(
    ("table", "count"),
    [
        ([(0.0, 1), [2.0, 3.0]], 2),
        (((0.0, 1.0),), 1),
        ([[0.0, 1.0, 2.0], [2.0, 3.0]], 0),
        ("ab", 0),
        (None, 0),
    ],
)
def test_rows_of_tables_that_are_whole(table, count):
    assert len(rows_of({"table": table})) == count


def test_faults_of_the_factor_of_a_load():
    factor = {"sine": {"amplitude": "3 mm"}, "start": 1.0, "stop": 2.0, "table": [[1.5, 0.0], [1.75, 0.0]]}
    assert list(factor_faults("f", factor, {"duration": 9.0})) == [
        ("f.sine.amplitude", "multiplies the load, so it has no unit, got '3 mm'"),
        ("f.table", "leaves a gap: its first row is at 1.5 s, but it acts from 1 s on"),
        ("f.table", "leaves a gap: its last row is at 1.75 s, but it acts until 2 s"),
    ]
    assert not list(factor_faults("f", {"start": 1.5, "table": factor["table"]}, {"duration": 1.75}))


def test_entries_of_a_path():
    scene = SCENE.with_(driver=(Driver(joint="A", polynomial=(0.0, 2.0)),))
    fields = {field: getattr(scene, field) for field in Scene.model_fields}
    once = replaced_at(fields, "driver[A].polynomial[1]", lambda value: value + 1.0)
    twice = replaced_at(once, "driver[0].polynomial[1]", lambda value: 2.0 * value)
    assert twice["driver"][0]["polynomial"] == (0.0, 6.0) and twice["body"] == scene.body
    for path in ("body[1].mass", "gravity[3]", "body[rod].mas", "bodies", "body[0]mass!", "name[0]", ""):
        with pytest.raises(SceneError, match=r"is not a path of a scene|the scene has no"):
            replaced_at(fields, path, lambda value: value)


@pytest.mark.parametrize("length", [1.0 - 0.9 * UNIT_TOLERANCE, 1.0 + 0.9 * UNIT_TOLERANCE])
def test_quaternions_of_nearly_unit_length_are_scaled(length):
    turned = (0.6 * length, 0.0, 0.8 * length, 0.0)
    body = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0), orientation=turned)
    assert body.orientation == pytest.approx((0.6, 0.0, 0.8, 0.0), abs=1e-15)
    far = tuple(x * (1.0 + 0.3 * UNIT_TOLERANCE * np.sign(length - 1.0)) for x in turned)
    with pytest.raises(ValueError, match="must be a unit quaternion"):
        Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0), orientation=far)


@pytest.mark.parametrize(
    ("text", "low", "high", "normal"),
    [("a=1:1", 1.0, 1.0, False), (" a =1+-0", 1.0, 0.0, True), ("a=-2:3", -2.0, 3.0, False)],
)
def test_spreads_without_width(text, low, high, normal):
    found = Variation.parse(text)
    assert (found.path, found.low, found.high, found.normal) == ("a", low, high, normal)
    value = found.draw(np.random.default_rng(5))
    assert value == 1.0 if low == 1.0 else value == np.random.default_rng(5).uniform(-2.0, 3.0)


@pytest.mark.parametrize("text", ["a=2:1", "a=1+--1", "a=1:inf", "a1:2", "a=1:2:3", "a=1"])
def test_spreads_that_are_refused(text):
    with pytest.raises(InputError, match="^" + repr(text).replace("+", r"\+")):
        Variation.parse(text)


@pytest.mark.parametrize(
    ("error", "tighter", "says"),
    [
        (1e-6, None, ""),
        (2e-6, None, "sensitive motion: error about 2e-06 from t = 2 s on"),
        (0.01, None, "sensitive motion: error about 0.01 from t = 2 s on"),
        (0.5, (1e-12, 1e-9), "sensitive motion: error about 0.5 from t = 2 s on; rtol 1e-12 gives 1e-09"),
        (0.5, (1e-12, 9e-10), "inaccurate run: error about 0.5 from t = 2 s on; rtol 1e-12 gives 9e-10"),
    ],
)
def test_warnings_begin_above_a_thousand_tolerances(error, tighter, says):
    """At a tolerance of 1e-10 the limit is 1e-6; the first error above it is at 2 s."""
    found = ErrorEstimate(
        np.array([0.0, 1.0, 2.0]), np.array([0.0, 1e-6, error]), 1e-10, "m", tighter=tighter
    )
    assert found.warning == says
    assert (found.exceeds_from(1e-6), found.exceeds_rtol_from) == (2.0 if error > 1e-6 else None, 1.0)


# --- frames that turn -------------------------------------------------------------------------------------
def test_motions_in_a_frame_that_turns_at_2_rad_per_s():
    """About z through (1, 0, 0): the body at (4, 0, 5) has 6 m/s along y, and its own axes are turned by 90°
    about x, so that z of the world is its y axis. A second body is the ground."""
    frame = Turning(np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.0]), "A")
    half = math.sqrt(0.5)
    q = np.array([4.0, 0.0, 5.0, half, half, 0.0, 0.0, *np.arange(7.0)])
    model: Any = SimpleNamespace(nb=2, scene=SimpleNamespace(body=[ROD]))
    ground = [0.0] * 6
    assert frame.rate == 2.0
    assert frame.velocities(model, q) == pytest.approx([0, 6, 0, 0, 2, 0, *ground])
    rate = np.array([1.0, 0.0, 7.0, 3.0, 0.0, 0.0, *[8.0] * 6])
    found = frame.relative(model, q, rate, np.ones(12))
    assert found == pytest.approx([1 + 12, 1 - 4, 1, 1, 1, 1 + 6, *[1.0] * 6])
    turned = frame.turned(model, q, math.pi / 2)
    assert turned == pytest.approx([1, 3, 5, 0.5, 0.5, 0.5, 0.5, *np.arange(7.0)])
    rates = frame.turned_rates(model, rate, math.pi / 2)
    assert rates == pytest.approx([0, 1, 7, 3, 0, 0, *[8.0] * 6])
    [body] = frame.bodies(SCENE.with_(body=(ROD.model_copy(update={"position": (4.0, 0.0, 5.0)}),)))
    assert body.velocity == (0.0, 6.0, 0.0) and body.angular_velocity == (0.0, 0.0, 2.0)
