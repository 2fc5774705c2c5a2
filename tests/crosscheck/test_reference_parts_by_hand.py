"""Parts of the reference / stiff panels, joints with fewer rows and certified tables worked out by hand."""

from __future__ import annotations

from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE, EXTENDED, doubles
from crosscheck.judge.gauss_principle import rank_of
from crosscheck.judge.reference import certify, isostatic
from crosscheck.judge.reference.certify import NotCertified
from crosscheck.judge.reference.panels import LAST, Panel, Panels
from crosscheck.judge.reference.stiff_panels import StiffPanels
from crosscheck.judge.reference.vectors import saddle_solve
from crosscheck.small_motions import records
from crosscheck.small_motions.compare import error
from crosscheck.small_motions.mechanisms import MECHANISMS
from mbref.scene import Body, Fixed, Revolute, Scene, Spherical, TorsionSpring, Translational, Universal

X, Y, Z, O = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
COUNT = 24


# --- stiff panels -----------------------------------------------------------------------------------------
class Decay:
    """z' = cos t and y' = -k (y - sin t) + cos t: both are sin t where they start there. z is cheap."""

    light = 1

    def __init__(self, k: float, distance: float = 1.0) -> None:
        self.k, self.away = k, distance

    def light_rates(self, y):
        return y[:, 1:2] * 0 + np.cos(self.t)[:, None]

    def other_rates(self, t, y):
        self.t = t
        rates = -self.k * (y[:, 1:] - np.sin(t)[:, None]) + np.cos(t)[:, None]
        return rates, np.abs(doubles(t) - self.away)

    def in_doubles(self):
        return Decay(self.k, self.away)


@pytest.fixture(scope="module", params=[DOUBLE, EXTENDED], ids=["double", "extended"])
def stiff(request) -> StiffPanels:
    return StiffPanels(Panels(request.param, COUNT))


def solved(stiff: StiffPanels, equations: Decay, length: float, start: float = 0.0) -> Panel:
    numbers = stiff.panels.arithmetic
    first = numbers.array([[np.sin(start), np.sin(start)]])
    return stiff.panel(
        equations, numbers.number(start), numbers.number(length), np.repeat(first, COUNT, axis=0)
    )


@pytest.mark.parametrize("k", [10.0, 1e6])
def test_a_stiff_panel_is_as_long_as_its_motion_is_smooth(stiff, k):
    panel = solved(stiff, Decay(k, distance=9.0), 1.0)
    t = (doubles(stiff.panels.nodes) + 1) / 2
    assert panel.settled and panel.factor > 0.3 and panel.foreseen is None
    assert np.abs(doubles(panel.states) - np.sin(t)[:, None]).max() < 100 * stiff.panels.tolerance
    assert (panel.start, panel.length) == (0.0, 1.0)


def test_a_stiff_panel_that_is_too_long_or_singular_is_shortened(stiff):
    long = solved(stiff, Decay(1e3, distance=99.0), 40.0)
    assert not long.settled and 0.0 < long.factor < 1.0
    crossed = solved(stiff, Decay(1e3, distance=0.5), 1.0)
    assert (
        not crossed.settled and crossed.factor == 0.6 and crossed.time(crossed.foreseen) == pytest.approx(0.5)
    )

    class Lost(Decay):
        def other_rates(self, t, y):
            rates, distance = super().other_rates(t, y)
            return rates * np.nan, distance

        def in_doubles(self):
            return Decay(self.k)

    lost = solved(stiff, Lost(1e3), 1.0)
    assert not lost.settled and lost.states.shape == (COUNT, 2) and np.all(lost.states == 0.0)


def test_panels_are_stiff_by_their_fastest_decay(stiff):
    """A decay of 1 ms and panels of 4.1 and 3.9 ms; the limit is four; 2500 unknowns at most."""
    state = stiff.panels.arithmetic.array([0.0, 0.0])
    for length, is_stiff in ((4.1e-3, True), (3.9e-3, False)):
        assert stiff.is_for(Decay(1e3), 0.0, length, state) is is_stiff
    assert not stiff.is_for(Decay(-1e3), 0.0, 1.0, state), "a growth is no decay"
    assert not stiff.is_for(Decay(np.nan), 0.0, 1.0, state)
    many = stiff.panels.arithmetic.zeros(2500 // COUNT + 1)
    assert not stiff.is_for(SimpleNamespace(), 0.0, 1.0, many)


def test_room_for_a_longer_panel(stiff):
    """A polynomial of degree 4 needs five coefficients of the room that a panel has."""
    x = stiff.panels.nodes
    y = np.stack([x**4, x**2], axis=1)
    assert stiff._fits(y, np.ones(2)) == (COUNT - LAST) / 5
    rough = np.stack([np.abs(x), x], axis=1)
    assert 0.0 < stiff._fits(rough, np.ones(2)) < 0.5


# --- joints with fewer rows -------------------------------------------------------------------------------
def block(name: str, x: float = 0.0) -> Body:
    return Body(name=name, mass=1.0, inertia=(1.0, 1.0, 1.0), position=(x, 0.0, 0.0))


def hinge(
    name: str, bodies: tuple[str, str], place: tuple[float, ...], axis: tuple[float, ...] = Z
) -> Revolute:
    return Revolute(name=name, bodies=bodies, anchor=place, axis=axis)


def weaker(joint: Any) -> list[list[str]]:
    return [[other.type for other in others] for others in isostatic._weaker(joint)]


def test_weaker_joints():
    ends = ("ground", "b")
    door = hinge("A", ends, X, (0.0, 0.0, 2.0))
    assert weaker(door) == [[], ["spherical"], ["planar"], ["cylindrical"], ["universal"], ["universal"]]
    *_, planar, cylindrical, one, other = (others[0] for others in list(isostatic._weaker(door))[1:])
    for joint in (planar, cylindrical, one, other):
        assert joint.name == "A" and joint.bodies == ends and joint.anchor_pair[0] == X
    assert np.allclose(np.cross(planar.directions[0], Z), 0.0)
    first, second = np.array(one.axes), np.array(other.axes)
    assert np.allclose(first[0], second[0]) and np.allclose(np.cross(first[0], Z), 0.0)
    assert np.allclose([first[0] @ first[1], second[0] @ second[1], first[1] @ second[1]], 0.0)
    assert weaker(Translational(name="A", bodies=ends, anchor=X, axis=Z)) == [[], ["cylindrical"]]
    assert weaker(Universal(name="A", bodies=ends, anchor=X, axes=(X, Y))) == [[], ["spherical"]]
    assert weaker(Fixed.at("A", ends, anchor=X)) == [[], ["spherical"]]
    assert weaker(Spherical(name="A", bodies=ends, anchor=X)) == [[]]


def door(*hinges: Revolute) -> Scene:
    return Scene(name="door", body=(block("b"),), joint=hinges, gravity=(0.0, -9.0, 0.0))


def test_the_second_hinge_of_a_door_is_removed():
    one, two = hinge("A", ("ground", "b"), O), hinge("B", ("ground", "b"), (0.0, 0.0, 1.0))
    found = isostatic.isostatic(door(one, two))
    assert found.joint == (one,) and isostatic.replaced(door(one, two), found) == {"B": "removed"}
    assert isostatic.isostatic(door(one)) == door(one)
    free = door()
    assert isostatic.isostatic(free) == free and isostatic._rank(free) == 0
    assert isostatic._singular_value(free, 0, (0.0, np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]))) == np.inf


def test_a_removal_that_nearly_loses_the_rank_is_refused():
    """A block on two ball joints and a rod-like third, 1 mm off their axis: without a ball at the end,
    the third joint alone holds the turn about the axis; its row is a thousandth of the others."""
    bodies = ("ground", "b")
    balls = [Spherical(name=n, bodies=bodies, anchor=place) for n, place in (("A", O), ("B", X))]
    near = Spherical(name="C", bodies=bodies, anchor=(0.5, 1e-3, 0.0))
    far = near.model_copy(update={"name": "D", "anchor": (0.5, 1.0, 0.0)})
    scene = Scene(name="s", body=(block("b"),), joint=(*balls, far, near))
    found = isostatic.isostatic(scene)
    assert "D" in {joint.name for joint in found.joint}, "the far one holds"
    assert isostatic._rank(found) == isostatic._rank(scene) == 6


def test_four_hinges_of_a_planar_loop_lose_three_rows():
    bodies = (block("a"), block("b", 1.0), block("c", 2.0))
    joints = (
        hinge("A", ("ground", "a"), O),
        hinge("B", ("a", "b"), (0.0, 1.0, 0.0)),
        hinge("C", ("b", "c"), (2.0, 1.5, 0.0)),
        hinge("D", ("ground", "c"), (2.0, 0.0, 0.0)),
    )
    scene = Scene(name="four-bar", body=bodies, joint=joints)
    found = isostatic.isostatic(scene)
    rows, _ = isostatic.jacobian(found, 0.0, *isostatic.initial_poses(found))
    assert len(rows) == isostatic._rank(scene) == isostatic._rank(found) == 17
    changed = isostatic.replaced(scene, found)
    assert changed and "removed" not in changed.values() and "A" not in changed, "the last joints first"


@pytest.mark.parametrize(("value", "is_removed"), [(0.021, True), (0.02, False)])
def test_a_joint_is_removed_if_the_rest_is_well_conditioned(monkeypatch, value, is_removed):
    """Without a joint the least singular value is a part of its value before, at each pose."""
    one, two = hinge("A", ("ground", "b"), O), hinge("B", ("ground", "b"), (0.0, 0.0, 1.0))
    asked: list[Any] = []

    def least(scene: Scene, rank: int, pose: Any) -> float:
        asked.append((len(scene.joint), rank, pose[0]))
        return 1.0 if scene == door(one, two) else value if pose[0] else 1.0

    monkeypatch.setattr(isostatic, "_singular_value", least)
    later = (0.5, np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]))
    found = isostatic.isostatic(door(one, two), [later])
    assert (found.joint == (one,)) is is_removed and (found == door(one, two)) is not is_removed
    assert asked[:2] == [(2, 5, 0.0), (2, 5, 0.5)]


def test_joints_whose_coordinates_are_used_stay():
    """A spring acts about the second hinge, so that the first one is removed; both cannot go."""
    one, two = hinge("A", ("ground", "b"), O), hinge("B", ("ground", "b"), (0.0, 0.0, 1.0))
    springs = [TorsionSpring(joint=name, stiffness=1.0) for name in "BA"]
    assert isostatic.isostatic(door(one, two).with_(load=springs[:1])).joint == (two,)
    both = door(one, two).with_(load=springs)
    assert isostatic.isostatic(both) == both


def test_replaced_joints_by_name():
    one, two = hinge("A", ("ground", "b"), O), hinge("B", ("ground", "b"), X)
    ball = Spherical(name="B", bodies=("ground", "b"), anchor=X)
    assert isostatic.replaced(door(one, two), door(one).with_(joint=(one, ball))) == {"B": "spherical"}
    assert isostatic._with(door(one, two), two, (ball,)).joint == (one, ball)
    assert isostatic._with(door(one, two), one, ()).joint == (two,)


# --- certified tables -------------------------------------------------------------------------------------
class Number(float):
    def __mul__(self, other: Any) -> Number:
        return Number(float(self) * float(other))

    __rmul__ = __mul__

    def str(self, digits: int, radius: bool) -> str:
        assert radius is False
        return f"{float(self):.{digits}g}"


def motion(**changes: Any) -> Any:
    """A motion of one body at two times, of numbers that write their digits."""
    made = {
        "times": np.array([0.0, 0.5]),
        "position": [[[1.0, 0.0, 2.0]]] * 2,
        "orientation": [[[-1.0, 0.0, 0.5, 0.0]], [[1.0, 0.0, 0.5, 0.0]]],
        "velocity": [[[4.0, 0.0, 0.0]]] * 2,
        "angular_velocity": [[[0.0, 0.0, 0.0]]] * 2,
        "crossings": (),
        "contradiction": 0.0,
        "reason": "",
        "reached": 0.5,
    }
    made |= changes
    for name in ("position", "orientation", "velocity", "angular_velocity"):
        values = np.array(made[name], dtype=float)
        made[name] = np.vectorize(Number, otypes=[object])(values)
    return SimpleNamespace(**made)


@pytest.fixture
def runs(monkeypatch) -> SimpleNamespace:
    """Stand-ins for both formulations: the motions that they give, and what they were asked for."""
    found = SimpleNamespace(asked=[], a=[motion()], b=[motion()], apart=[1e-14])

    def natural(scene, times, exact, order=None, tolerance=None, progress=None):
        found.asked.append(("A", scene.name, exact.digits, order, tolerance, progress))
        return found.a.pop(0) if len(found.a) > 1 else found.a[0]

    def tree(scene, times, exact, seconds, progress):
        found.asked.append(("B", scene.name, exact.digits, None, seconds, progress))
        return found.b[0]

    monkeypatch.setattr(certify, "natural_motion", natural)
    monkeypatch.setattr(certify, "tree_motion", tree)
    monkeypatch.setattr(certify, "many_digits", lambda digits: SimpleNamespace(digits=digits))
    apart = lambda *_: np.array([0.0, found.apart.pop(0) if len(found.apart) > 1 else found.apart[0]])  # noqa: E731
    monkeypatch.setattr(certify, "differences", apart)
    monkeypatch.setattr(
        certify, "isostatic", lambda scene, poses: scene.with_(name=f"isostatic at {poses}", joint=())
    )
    monkeypatch.setattr(certify, "_poses", lambda scene, end: end)
    return found


SCENE = door(hinge("A", ("ground", "b"), O))
TIMES = np.array([0.0, 0.5])


@contextmanager
def shown(name: str):
    yield f"progress of {name}"


def test_digits_on_which_both_formulations_agree(runs):
    table = certify.certified(SCENE, TIMES, 10, shown=shown)
    assert runs.asked == [
        ("A", "door", 20, 20, 10.0**-16, "progress of formulation A"),
        ("B", "door", 16, None, np.inf, "progress of formulation B"),
    ]
    assert table["bound"] == f"{certify.SAFETY * 1e-14:.0e}" and table["rate_bound"] == "1e-16"
    assert table["methods"] == certify.METHODS and table["digits"] == 10 and table["bodies"] == ["b"]
    assert table["times"] == [0.0, 0.5] and table["position"][0] == [["1", "0", "2"]]
    assert table["orientation"] == [[["1", "0", "-0.5", "0"]], [["1", "0", "0.5", "0"]]], "w is positive"
    assert "replaced" not in table and table["hash"] == certify.digest(table)
    assert certify.digest(table | {"digits": 11}) != table["hash"]
    other = certify.certified(SCENE.with_(gravity=X), TIMES, 10)
    assert other["id"] != table["id"], "the id is of the scene"


def test_velocities_have_a_bound_of_their_own(runs):
    """Velocities of 4 and 5 m/s: a quarter of the largest."""
    runs.b = [motion(velocity=[[[4.0, 0.0, 0.0]], [[5.0, 0.0, 0.0]]])]
    table = certify.certified(SCENE, TIMES, 10)
    assert table["rate_bound"] == f"{certify.SAFETY * 0.25:.0e}"
    assert certify._apart(np.zeros(2), np.array([0.0, 3.0])) == 3.0
    assert certify._apart(np.array([2.0, -4.0]), np.array([2.0, -3.0])) == 0.25


def test_more_digits_are_tried_once(runs):
    runs.apart = [1e-9, 1e-14]
    assert certify.certified(SCENE, TIMES, 10)["bound"] == f"{certify.SAFETY * 1e-14:.0e}"
    assert [a[4] for a in runs.asked if a[0] == "A"] == [10.0**-16, 10.0**-22]
    assert [a[2] for a in runs.asked if a[0] == "B"] == [16, 22]
    runs.apart = [2e-9]
    with pytest.raises(
        NotCertified, match=f"^door: the formulations agree to {certify.SAFETY * 2e-9:.0e} only$"
    ):
        certify.certified(SCENE, TIMES, 10)
    runs.apart, runs.asked[:] = [0.99e-10 / certify.SAFETY], []
    certify.certified(SCENE, TIMES, 10)
    assert len(runs.asked) == 2, "a bound of the digits that are asked for"


def test_contradictory_rows_are_removed_first(runs):
    runs.a = [motion(contradiction=1.1e-10), motion()]
    table = certify.certified(SCENE, TIMES, 10)
    assert [a[:2] for a in runs.asked] == [
        ("A", "door"),
        ("A", "isostatic at 0.5"),
        ("B", "isostatic at 0.5"),
    ]
    assert table["scene"] == "door" and table["replaced"] == {"A": "removed"}
    runs.a, runs.asked[:] = [motion(contradiction=1e-10)], []
    certify.certified(SCENE, TIMES, 10)
    assert [a[1] for a in runs.asked] == ["door", "door"]


def test_through_singular_positions_a_formulation_runs_twice(runs):
    runs.a = [motion(crossings=(0.25,))]
    table = certify.certified(SCENE, TIMES, 12, shown=shown)
    assert [(a[0], a[3], a[4]) for a in runs.asked] == [
        ("A", 24, 10.0**-18),
        ("A", 36, 10.0**-24),
        ("A", 42, 10.0**-28),
    ]
    assert table["methods"] == certify.ACROSS


def test_motions_that_end_are_not_certified(runs):
    ended = {"reason": "it locks", "reached": 0.25}
    runs.a = [motion(**ended)]
    with pytest.raises(NotCertified, match=r"^door: A ends at t = 0\.25 s: it locks$"):
        certify.certified(SCENE, TIMES, 10)
    assert len(runs.asked) == 1, "the second formulation does not run"
    runs.a, runs.b = [motion()], [motion(**ended)]
    with pytest.raises(NotCertified, match=r"^door: B ends at"):
        certify.certified(SCENE, TIMES, 10)
    with pytest.raises(NotCertified, match=r"^door: "):
        certify.certified(SCENE, TIMES, 10, seconds=-1.0)


def test_poses_along_a_motion(monkeypatch):
    """101 poses from the start to the end, in doubles."""
    asked: list[Any] = []

    def moved(scene: Scene, times: np.ndarray, numbers: Any) -> Any:
        asked.append((scene, times.tolist(), numbers))
        place, turn = (
            np.arange(6, dtype=np.longdouble).reshape(2, 1, 3),
            np.ones((2, 1, 4), dtype=np.longdouble),
        )
        return SimpleNamespace(times=times[:2], position=place, orientation=turn)

    monkeypatch.undo()
    monkeypatch.setattr(certify, "natural_motion", moved)
    (first, place, turn), (second, later, _) = certify._poses(SCENE, 4.0)
    assert asked == [(SCENE, pytest.approx([0.04 * k for k in range(101)]), EXTENDED)]
    assert (first, second) == (0.0, 0.04) and type(second) is float
    assert (
        place.tolist() == [[0, 1, 2]] and later.tolist() == [[3, 4, 5]] and turn.dtype == place.dtype == float
    )


def test_decimals_have_two_digits_more():
    assert certify._decimals(np.array([[Number(1 / 3), Number(0.0)]], dtype=object), 5) == [
        ["0.3333333", "0"]
    ]
    with certify.unshown("A") as progress:
        assert progress is certify.no_progress


# --- closed forms of small motions ------------------------------------------------------------------------
@pytest.mark.parametrize("mechanism", MECHANISMS, ids=lambda m: m.name)
def test_closed_forms_are_the_eigenvalues_that_the_judge_stored(mechanism):
    """Each closed form is met by a stored pose, and each stored pose meets one."""
    known = [np.array(values) for values in mechanism.known()]
    stored = [
        np.array([complex(*pair) for pair in record["eigenvalues"]])
        for record in records.read()
        if record["scene"] == mechanism.name
    ]
    apart = np.array([[error(exact, found) for exact in known] for found in stored])
    assert apart.min(axis=0).max() < 1e-11 and apart.min(axis=1).max() < 1e-11


def test_slender_rods_and_a_pendulum():
    """Slender rods of a double pendulum: ω² = 3 (1 ± 2/√7) g/l; 13.734 N m/rad and 1.28 kg m² of one arm."""
    by_name = {mechanism.name: mechanism.known() for mechanism in MECHANISMS}
    hanging, *_, standing = by_name["double_pendulum"]
    rates = np.sqrt(3 * 9.81 * (1 + np.array([-2.0, 2.0]) / np.sqrt(7)))
    assert sorted(s.imag for s in hanging if s.imag > 0) == pytest.approx(rates)
    assert sorted(s.real for s in standing if s.real > 0) == pytest.approx(rates)
    below, above = by_name["pendulum"]
    assert below[0] == pytest.approx(1j * np.sqrt(13.734 / 1.28)) and above[1] == pytest.approx(below[0].imag)


# --- linear equations -------------------------------------------------------------------------------------
def test_a_saddle_point_system_by_hand():
    """2 x + λ = 4, 3 y + λ = 6 and x + y = 1: λ = 3.6, x = 0.2, y = 0.8."""
    arrays = (np.diag([2.0, 3.0]), np.array([[1.0, 1.0]]), np.array([4.0, 6.0]), np.array([1.0]))
    found, distance = saddle_solve(*(array[None] for array in arrays))
    assert found[0] == pytest.approx([0.2, 0.8], abs=1e-15) and 0.1 < distance[0] < 1.0
    exact, _ = saddle_solve(*(EXTENDED.array(array[None]) for array in arrays))
    assert np.abs(exact[0] - EXTENDED.array([1, 4]) / 5).max() < 1e-18
    twice = [np.concatenate([a[None], a[None]]) for a in arrays]
    twice[1][1] = 0.0
    _, (regular, singular) = saddle_solve(*twice)
    assert singular < 1e-3 < regular, "the second sample has lost its row"
    nothing, distance = saddle_solve(
        np.zeros((1, 0, 0)), np.zeros((1, 0, 0)), np.zeros((1, 0)), np.zeros((1, 0))
    )
    assert nothing.shape == (1, 0) and distance[0] == np.inf


@pytest.mark.parametrize(("light", "entry"), [(1.5e-12, 1.0), (1e-12, 1.0), (0.5e-12, 0.5)])
def test_light_masses_are_scaled_to_a_least_size(light, entry):
    """Masses below 1e-12 of the largest are scaled like this size: the entry is the ratio."""
    mass = np.diag([4.0, 4.0 * light])[None]
    _, distance = saddle_solve(mass, np.zeros((1, 0, 2)), np.zeros((1, 2)), np.zeros((1, 0)))
    assert distance[0] == pytest.approx((1 + entry**-2) ** -0.25, rel=1e-9)


def test_rank_is_relative_to_the_largest_singular_value():
    assert rank_of(np.array([1e-3, 1.1e-12, 0.9e-12])) == 2 and rank_of(np.array([1e3, 1.1e-6, 0.9e-6])) == 2
    assert rank_of(np.zeros(0)) == 0 == rank_of(np.zeros(2))
