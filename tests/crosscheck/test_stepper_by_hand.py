"""Steps of formulation A / choices of rows, refusals, projections and samples on stand-ins by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE
from crosscheck.judge.reference import expansion, taylor
from crosscheck.judge.reference.taylor import Ended, Stepper

EPS = 2.0**-52


def stepper(**parts: Any) -> Any:
    """A stepper without a scene; parts replace what it asks of one."""
    made: Any = object.__new__(Stepper)
    made.of = SimpleNamespace(arithmetic=DOUBLE)
    made.t = 0.0
    made.__dict__.update(parts)
    return made


def test_well_conditioned_rows_have_pivots_above_a_ten_thousandth(monkeypatch):
    asked: list[Any] = []
    pivots = np.array([1.0, 1.1e-4, 1e-4, 0.9e-4])
    monkeypatch.setattr(
        taylor, "independent", lambda *given: asked.append(given) or (np.array([0, 2]), pivots)
    )
    monkeypatch.setattr(taylor, "HeldRows", lambda of, rows: (of, rows.tolist()))
    made = stepper(_every=SimpleNamespace(unit_gradient=lambda x, t: (x, t)), _weights="weights")
    assert made._choice("x", 0.5) == ((made.of, [0, 2]), 2) and asked == [(("x", 0.5), "weights")]


@pytest.mark.parametrize(("x", "size"), [([[1.0, -4.0]], 4.0), ([[0.25, -0.5]], 1.0), ([[3.0]], 3.0)])
def test_the_size_of_coordinates_is_one_at_least(x, size):
    assert stepper(_x=np.array(x))._size() == size


def test_the_smallest_singular_value_of_the_selected_rows():
    rows = SimpleNamespace(unit_gradient=lambda x, t: np.diag([1.0, 0.25, 0.5]) * (x + t))
    assert stepper(_held=rows)._sharp(1.0, 3.0) == pytest.approx(1.0)


@pytest.mark.parametrize(("count", "is_refused"), [(3, False), (4, True), (2, False)])
def test_a_start_at_which_rows_are_missing_is_refused(count, is_refused):
    """1 + 2 d at a distance of 0.5 s, at 1.5 s."""
    asked: list[Any] = []
    made = stepper(t=1.0, _held=SimpleNamespace(count=3))
    made._choice = lambda x, t: asked.append((x.tolist(), t)) or (None, count)
    series = np.array([[1.0], [2.0]])
    if is_refused:
        with pytest.raises(Ended, match="it starts in a singular position"):
            made._refuse_singular_start(series, 0.5)
    else:
        made._refuse_singular_start(series, 0.5)
    assert asked == [([2.0], 1.5)]


# --- degrees of freedom without inertia -------------------------------------------------------------------
def undetermined(masses: dict[int, float], of_joints: float = 0.0, *, free: tuple[int, ...] = (1, 7)) -> Any:
    """Two bodies whose coordinates are held, except the second direction of some; 2 kg elsewhere."""
    mass = np.diag([2.0] * 8)
    for k, value in masses.items():
        mass[k, k] = value
    held = [8 * c + n for c in range(3) for n in range(8) if not (c == 1 and n in free)]
    rows = np.eye(24)[held]
    geared = np.zeros((24, 24))
    geared[15, 15] = of_joints
    return stepper(
        of=SimpleNamespace(
            arithmetic=DOUBLE,
            nb=2,
            mass=mass,
            joints=SimpleNamespace(mass=lambda x: geared),
            scene=SimpleNamespace(
                has_mass=lambda: True, body=[SimpleNamespace(name="a"), SimpleNamespace(name="b")]
            ),
        ),
        _held=SimpleNamespace(unit_gradient=lambda x, t: rows),
        _x=np.zeros((3, 12)),
    )


@pytest.mark.parametrize(
    ("masses", "of_joints", "name"),
    [
        ({}, 0.0, ""),
        ({7: 0.0}, 0.0, "b"),
        ({1: 0.0}, 0.0, "a"),
        ({7: 2e-13}, 0.0, "b"),
        ({7: 2.1e-13}, 0.0, ""),
        ({7: 0.0}, 0.1, ""),
        ({2: 0.0}, 0.0, ""),
    ],
)
def test_a_freedom_without_inertia_names_its_body(masses, of_joints, name):
    """1e-13 of the largest inertia counts as none; an armature is an inertia."""
    made = undetermined(masses, of_joints)
    if name:
        with pytest.raises(Ended, match=f"^body '{name}' can turn without inertia$"):
            made._refuse_undetermined()
    else:
        made._refuse_undetermined()


def test_bodies_without_mass_need_drivers():
    made = undetermined({})
    made.of.scene.has_mass = lambda: False
    with pytest.raises(Ended, match="have to be driven in every freedom"):
        made._refuse_undetermined()
    held = undetermined({}, free=())
    held.of.scene.has_mass = lambda: False
    held._refuse_undetermined()


# --- projections ------------------------------------------------------------------------------------------
def projected(monkeypatch: Any, place: float, rate: float, **parts: Any) -> tuple[Any, list[Any]]:
    """A projection with constant gaps of places and rates; the corrections that it asks for."""
    asked: list[Any] = []

    def solve(still: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, None]:
        assert not still.any() and still.shape == (3, 1)
        asked.append(right.tolist())
        return np.full((3, 1), parts.get("step", 0.25)), None

    def system(mass: Any, rows: Any, compliance: Any, numbers: Any) -> Any:
        assert (mass, compliance, numbers) == ("mass", "compliance", DOUBLE) and len(rows) == 2
        return SimpleNamespace(solve=solve)

    monkeypatch.setattr(taylor, "SaddlePoint", system)
    held = SimpleNamespace(
        count=1,
        drives=lambda t, terms: (t, terms),
        all_gradients=lambda x, drives: np.ones((2, 3, 1)) if drives == (0.5, 1) else None,
        compliance=lambda zeros: "compliance",
    )
    joints = SimpleNamespace(values=lambda x, near: [near[0] + x[0, 0]])
    made = stepper(
        of=SimpleNamespace(arithmetic=DOUBLE, mass="mass", joints=joints),
        t=0.5,
        _held=held,
        _x=np.full((3, 5), parts.get("x", -2.0)),
        _v=np.full((3, 5), 0.5),
        _turned=[1.0],
        _gaps=lambda held: (np.array([place]), np.array([-rate])),
    )
    made._project()
    return made, asked


@pytest.mark.parametrize(
    ("place", "rate", "corrections"),
    [
        (8 * EPS, 4 * EPS, []),
        (8.1 * EPS, 4 * EPS, [8.1 * EPS] * 4),
        (8 * EPS, 4.1 * EPS, [-4.1 * EPS] * 2),
        (1.0, 2.0, [1.0] * 4 + [-2.0] * 2),
    ],
)
def test_corrections_of_places_and_rates(monkeypatch, place, rate, corrections):
    """Gaps of four roundings are left, of coordinates of 2 and of rates below 1; four and two at most."""
    made, asked = projected(monkeypatch, place, rate)
    assert asked == [[-gap, 0.0] for gap in corrections]
    moved, turned = sum(gap > 0 for gap in corrections), sum(gap < 0 for gap in corrections)
    assert made._x[:, :1].tolist() == [[-2.0 + 0.25 * moved]] * 3 and (made._x[:, 1:] == -2.0).all()
    assert made._v[:, :1].tolist() == [[0.5 + 0.25 * turned]] * 3 and (made._v[:, 1:] == 0.5).all()
    assert made._turned == [1.0 - 2.0 + 0.25 * moved]


@pytest.mark.parametrize(("place", "rate"), [(1.0, 0.0), (0.0, 1.0)])
def test_coordinates_that_are_not_finite_end_a_motion(monkeypatch, place, rate):
    with pytest.raises(Ended, match="a pivot of its equations is zero to the digits of the arithmetic"):
        projected(monkeypatch, place, rate, step=np.inf)


def test_without_rows_nothing_is_projected():
    made = stepper(_held=SimpleNamespace(count=0))
    made._project()
    assert set(vars(made)) == {"of", "t", "_held"}


# --- a step that is taken ---------------------------------------------------------------------------------
def test_a_step_that_is_taken(monkeypatch):
    """1 + 2 t + 3 t² at 0.5 s, its rate, and angles of as many terms as the coordinates have."""
    done: list[Any] = []
    made = stepper(
        t=1.0,
        steps=4,
        contradiction=0.125,
        _conditioning=[0.7],
        _every="every",
        _x=None,
        _sharp=lambda x, t: done.append((x.tolist(), t)) or 0.6,
        _choose_again=lambda: done.append("choose"),
        _project=lambda: done.append("project"),
        _gaps=lambda held: (np.array([0.5, -3.0]), None) if held == "every" else None,
        _size=lambda: 8.0,
    )
    series = np.array([[1.0], [2.0], [3.0]])
    angles = [np.array([5.0, 6.0, 7.0, 99.0])]
    turned = [np.array([0.5, 0.25, 0.0, 99.0])]
    made._advance(SimpleNamespace(angles=angles, turned=turned), series, 0.5)
    assert made._x.tolist() == [2.75] and made._v.tolist() == [5.0] and (made.t, made.steps) == (1.5, 5)
    assert made._angles == [5.0 + 3.0 + 1.75] and made._turned == [0.625]
    assert made._conditioning == [0.7, 0.6] and done == [([2.75], 1.5), "choose", "project"]
    assert made.contradiction == 3.0 / 8.0
    made._gaps = lambda held: (np.array([0.5]), None)
    made._advance(SimpleNamespace(angles=angles, turned=turned), series, 0.5)
    assert made.contradiction == 3.0 / 8.0, "the largest one"


def test_an_expansion_is_about_the_present_state(monkeypatch):
    monkeypatch.setattr(taylor, "Expansion", lambda *given: given)
    names = {f"_{name}": name for name in ("held", "loads", "angles", "turned", "x", "v")}
    made = stepper(t=0.5, **names)
    wanted = (made.of, "held", "loads", 9, 0.5, ("x", "v"), "angles", "turned")
    assert made._expansion(9) == wanted and expansion.LEAST_TERMS == 6


def test_conditioning_at_the_end_of_a_step():
    """The series is cut to the terms that the step needs: 1 + 2 · 0.5 at 1.5 s."""
    asked: list[Any] = []
    made = stepper(t=1.0, _sharp=lambda x, t: asked.append((x.tolist(), t)) or 0.3)
    series = np.array([[1.0], [2.0], [99.0]])
    assert made._ahead(series, SimpleNamespace(terms=lambda h: 2 if h == 0.5 else 3), 0.5) == 0.3
    assert asked == [([2.0], 1.5)]


@pytest.mark.parametrize("of_angle", [True, False])
def test_gaps_of_rows_and_couplings(of_angle):
    """u = x, w = 3 x: products 3 x² and 6 x v, minus the right-hand sides 2 + 5 t; couplings follow."""
    drives = SimpleNamespace(combined=lambda products, k: products[k], c=np.array([[2.0], [5.0]]))
    held = SimpleNamespace(
        drives=lambda t, terms: drives if (t, terms) == (0.5, 2) else None,
        u=lambda x: x,
        w=lambda x: 3 * x,
        couplings="couplings",
    )

    def gaps(*given: Any) -> Any:
        assert (
            given[0] == "couplings" and given[1] is made._x and given[2] is made._v and given[3] == "turned"
        )
        return (np.array([7.0]), np.array([8.0])) if of_angle else (np.zeros(0), np.zeros(0))

    x, v = np.array([[1.0], [2.0], [0.0]]), np.array([[0.5], [1.0], [4.0]])
    made = stepper(t=0.5, _x=x, _v=v, _turned="turned")
    made.of.joints = SimpleNamespace(gaps=gaps)
    place, rate = made._gaps(held)
    assert place.tolist() == [3 * 5.0 - 2.0, *([7.0] if of_angle else [])]
    assert rate.tolist() == [6 * 2.5 - 5.0, *([8.0] if of_angle else [])]


# --- settings of a motion ---------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("asked", "wanted"),
    [
        ({}, (28, EPS, (0, 0.0))),
        ({"order": 9, "tolerance": 1e-7, "seed": 3, "displaced": 0.5}, (9, 1e-7, (3, 0.5))),
    ],
)
def test_settings_of_a_motion_and_their_defaults(monkeypatch, asked, wanted):
    """The first run has the order 28, the tolerance of rounding and no displaced joints."""
    seen: list[Any] = []

    class Begun(Exception):
        """A stepper is asked for."""

    def begin(scene: Any, numbers: Any, *settings: Any) -> None:
        seen.append((scene, numbers, settings))
        raise Begun

    monkeypatch.setattr(taylor, "Stepper", begin)
    with pytest.raises(Begun):
        taylor.natural_motion("scene", [0.0], DOUBLE, **asked)
    assert seen == [("scene", DOUBLE, wanted)]


def test_a_loss_of_a_hundred_tolerances_is_enough():
    for loss, is_enough in ((1e-12, True), (1.1e-12, False)):
        made = stepper(_lost=np.inf, _tolerance=1e-14, _conditioning=[1.0])
        assert made._may_step_across(loss) is is_enough


@pytest.mark.parametrize(("reach", "last"), [(0.25, 0.5), (2.0, 2.0)])
def test_lengths_at_which_a_singular_position_is_searched(reach, last):
    """Twenty-four lengths from a quarter of the step, to its end or as far as the series reaches."""
    lengths: list[float] = []
    made = stepper(
        _tolerance=1e-14,
        _conditioning=[1.0],
        _ahead=lambda x, series, h: lengths.append(h) or 1.0 / h,
    )
    series = SimpleNamespace(reach=lambda tolerance: reach if tolerance == 1e-7 else None)
    assert made._crossing(None, series, 0.5) == 0.0
    assert lengths == pytest.approx((0.125 * (last / 0.125) ** (np.arange(24) / 23)).tolist())
