"""Lines that commands print / findings, motions and tables worked out by hand."""

from __future__ import annotations

import argparse
import json
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from rich.table import Table

from mbref.cli import diagnose, main, statics, tables
from mbref.design.along_motion import AlongMotion
from mbref.design.equilibrium import Equilibrium
from mbref.drawing import film, picture
from mbref.equations.diagnosis import Diagnosis
from mbref.scene import Body, Driver, Factor, Revolute, Scene, Sine
from mbref.scene_services import Counts
from mbref.scene_toml import toml_hint, with_lines
from mbref.simulation import remedies
from mbref.trajectory import Outcome, Trajectory

BAR = Body(name="bar", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(0.5, 0.0, 0.0))
HINGE = Revolute(name="A", bodies=("ground", "bar"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
SCENE = Scene(name="door", body=(BAR,), joint=(HINGE,), duration=1.0)
COUNTS = Counts(
    coordinates=12, rows=11, rows_by_joint={"A": 5, "B": 6}, rank=9, redundant=2, degrees_of_freedom=3
)
FOUND = Diagnosis(
    counts=COUNTS,
    redundant_by_joint={"A": 1, "B": 2},
    unique_reactions=("C",),
    smallest_singular_value=0.123456,
    largest_singular_value=1.5,
    determined_reactions={"A": ("force x",), "B": ("force x",), "C": ("force y",), "D": ()},
)


def test_lines_on_the_start():
    assert diagnose._start_lines(FOUND) == [
        "  at t = 0",
        "    coordinates         12",
        "    constraint rows     11   (A 5, B 6)",
        "    rank                9",
        "    redundant rows      2",
        "    degrees of freedom  3",
        "    rows in redundancy  A 1, B 2",
        "    unique reactions    C",
        "    determined          force x of A, B",
        "    determined          nothing of D",
        "    singular values     0.123 to 1.5 (rows of unit length;",
        "                        the smallest is 0 in a singular position)",
    ]
    assert diagnose._listed({}) == "none"
    assert diagnose._unique(Diagnosis(COUNTS, {}, (), 0.1, 1.0)) == "none as a whole"
    assert diagnose._determined_lines(Diagnosis(COUNTS, {}, (), 0.1, 1.0)) == []


def along(**changes: object) -> AlongMotion:
    made = {"end": 2.0, "moves": True, "rank": 9, "redundant": 2, "by_rounding": (), "nearest": 0.25}
    made |= {"nearest_time": 0.5, "crossings": (), "shaky": False, "stopped": ""}
    return AlongMotion(**{**made, **changes})


def test_lines_along_the_motion():
    nearest = "    nearest singular    at t = 0.5 s: smallest singular value 0.25 of the largest"
    plain = ["  along the motion of 2 s", "    rank                9", "    redundant rows      2", nearest]
    assert diagnose._motion_lines(along()) == plain
    assert diagnose._motion_lines(None) == []
    assert diagnose._motion_lines("it is locked") == ["  along the motion      not known: it is locked"]
    assert diagnose._motion_lines(along(moves=False))[0] == "  along the motion of 2 s: nothing moves"
    early = diagnose._motion_lines(along(moves=False, stopped="the step failed"))
    assert early[:2] == ["  along the motion of 2 s", "    it ends early       the step failed"]
    assert diagnose._motion_lines(along(nearest=9.9e-4))[-1].endswith(
        "0.00099 of the largest (passed, or nearly)"
    )
    assert diagnose._motion_lines(along(nearest=1e-3))[-1].endswith("0.001 of the largest")
    crossings = tuple(SimpleNamespace(time=0.1 * k, sentence=f"number {k}") for k in range(1, 7))
    lines = diagnose._motion_lines(along(crossings=crossings))
    assert lines[3:] == [
        *(f"    singular position   at t = 0.{k} s: number {k}" for k in range(1, 6)),
        "    singular positions  6 in all",
    ]
    assert len(diagnose._motion_lines(along(crossings=crossings[:5]))) == 8
    assert "infinitesimal" in diagnose._motion_lines(along(shaky=True))[-1]
    assert diagnose._motion_lines(along(by_rounding=(1e-9, 2e-12)))[-1] == (
        "    nearly redundant    singular values up to 1e-09, 2e-12, explained by rounding of the numbers"
    )


def test_lines_on_exchanges_drivers_and_links():
    assert diagnose._swap_lines([], False) == []
    assert diagnose._swap_lines([], True) == [
        "  no exchange or removal of joints that was tried ends the redundancy"
    ]
    assert diagnose._swap_lines([{"A": "spherical", "B": "removed"}, {"C": "universal"}], True)[1:] == [
        "    A spherical and B removed",
        "    C universal",
    ]
    assert diagnose._driver_lines(SCENE) == []
    driver = Driver(joint="A", polynomial=(0.0, 1.0))
    assert diagnose._driver_lines(SCENE.with_(driver=(driver,))) == []
    held = SCENE.with_(
        joint=(HINGE, HINGE.model_copy(update={"name": "B", "anchor": (1.0, 0.0, 0.0)})), driver=(driver,)
    )
    assert diagnose._driver_lines(held) == [
        "  more drivers than degrees of freedom (1 and 0): redundant rows remain"
    ]
    assert diagnose._scene_lines(SCENE)[-2:] == ["  joints", "    A            revolute, ground and bar"]
    assert diagnose._unit_lines("four_bar") == []


def test_only_a_redundant_motion_is_redundant():
    assert diagnose.along_redundant(along()) and not diagnose.along_redundant(along(redundant=0))
    assert not diagnose.along_redundant(None) and not diagnose.along_redundant("locked")


def test_record_of_a_diagnosis():
    record = diagnose._record(SCENE, FOUND, None, [{"A": "spherical"}])
    assert record["along_motion"] is None and record["exchanges"] == [{"A": "spherical"}]
    assert record["redundant"] == 2 and record["unique_reactions"] == ("C",) and "counts" not in record
    assert diagnose._record(SCENE, FOUND, "locked", [])["along_motion"] == {"why_not": "locked"}
    assert diagnose._record(SCENE, FOUND, along(), [])["along_motion"]["nearest"] == 0.25


def rest(values: list[complex], rate: float = 0.0) -> Equilibrium:
    turned = BAR.model_copy(update={"orientation": (math.cos(0.25), 0.0, 0.0, math.sin(0.25))})
    wrench = {"A": np.array([1.0, 2.0, 1e-12, 0.0, 0.0, -3.5])}
    scene = SCENE.with_(body=(turned,))
    return Equilibrium(scene, np.array(values), np.zeros((len(values), 1, 6)), wrench, rate)


def test_lines_of_an_equilibrium_and_its_vibrations():
    """Eigenvalues -3 ± 4 i: 5 / 2π Hz with a damping ratio of 0.6."""
    found = rest([-3 + 4j, -3 - 4j])
    assert statics._lines(2, found) == [
        "equilibrium 2: stable",
        "  bar          position (0.5, 0, 0) m, rotation vector (0, 0, 0.5) rad",
        "  joint A      force (1, 2, 0) N, moment (0, 0, -3.5) N m",
    ]
    assert statics._mode_lines(1, found) == [
        "equilibrium 1: stable",
        "  eigenvalues, 1/s",
        "    -3 +4 i",
        "    -3 -4 i",
        f"  vibration 1: {5 / (2 * math.pi):.9g} Hz, damping ratio 0.6",
    ]
    assert statics._title(3, rest([2.0, -2.0], 7.5)) == "steady motion 3: unstable, turns at 7.5 rad/s"
    assert rest([0j, 0j]).stability == rest([]).stability == "indifferent"
    record = statics._record(found)
    assert record["eigenvalues"] == [[-3.0, 4.0], [-3.0, -4.0]] and record["rate"] == 0.0
    assert record["damping_ratios"] == [0.6] and record["reactions"]["A"][5] == -3.5


def asked(**changes: object) -> argparse.Namespace:
    return argparse.Namespace(**{"scene": "four_bar", "starts": 3, "number": None, "json": False, **changes})


def test_options_of_the_search_for_equilibria(monkeypatch):
    monkeypatch.setattr(
        "mbref.design.equilibrium.equilibria", lambda scene, starts: [rest([])] * (starts - 1)
    )
    assert len(statics._found(asked())) == 2 and len(statics._found(asked(number=2))) == 2
    for given, says in (
        ({"starts": 0}, "--starts: must be at least 1, got 0"),
        ({"number": 0}, "--number: must be from 1 to 2, got 0"),
        ({"number": 3}, "--number: must be from 1 to 2, got 3"),
        ({"starts": 1}, "four_bar: no equilibrium is found from 1 starts; --starts tries more"),
        (
            {"starts": 1, "scene": "planar_slider_crank"},
            r"perhaps load\[0\] \(moment\) moves it at every pose; --starts tries more",
        ),
    ):
        with pytest.raises(ValueError, match=says):
            statics._found(asked(**given))


def cells(table: Table) -> list[list[str]]:
    return [[str(cell) for cell in column.cells] for column in table.columns]


def test_tables_of_scenes_methods_and_outputs():
    names, bodies, joints, moved, ends = cells(tables._scenes())
    rows = {name: row for name, *row in zip(names, bodies, joints, moved, ends, strict=True)}
    assert rows["four_bar"] == ["3", "4", "driver of A", "0.1"]
    assert rows["planar_slider_crank"] == ["3", "4", "moment", "0.4"]
    assert rows["h_frame"] == ["2", "3", "gravity", "1"]
    assert rows["flyball_governor"] == ["4", "4", "gravity, spring, spring", "10"]
    parts, names, meanings = cells(tables._methods())
    found = dict(zip(zip(parts, names, strict=True), meanings, strict=True))
    assert found["integrator", "rk4"] == "classical Runge-Kutta with a fixed step (s)\n[step=0.0001]"
    assert found["stabilisation", "none"] == "constraint violations grow"
    assert "[alpha=" in found["stabilisation", "baumgarte"] and ("formulation", "lm1") in found
    table = tables._outputs()
    columns, *_ = cells(table)
    assert [row.end_section for row in table.rows].count(True) == len({o.owner for o in tables.OUTPUTS}) - 1
    assert columns == [output.column for output in tables.OUTPUTS]


STEPS = (remedies.STEP_TOO_SMALL, remedies.TOO_MANY_STEPS, remedies.CREEPING)


def failed(formulation: str = "lm1", is_series: bool = False, loops: bool = True) -> SimpleNamespace:
    method = SimpleNamespace(formulation=remedies.FORMULATIONS[formulation], is_series=is_series)
    model = SimpleNamespace(mass=np.ones(6), closed_loops=loops)
    return SimpleNamespace(method=method, scene=SCENE, model=model, start=SimpleNamespace(q=np.zeros(7)))


@pytest.fixture(autouse=True)
def _rows_of_the_hinge(monkeypatch):
    monkeypatch.setattr(remedies, "scaled_jacobian", lambda model, t, q: np.eye(5, 6))


def test_a_body_of_mass_zero_that_nothing_holds_is_named():
    """The rows of the hinge leave the sixth coordinate of the bar free."""
    run = failed()
    assert remedies._undetermined(run) == ""
    run.scene = SCENE.with_(body=(BAR.model_copy(update={"mass": 0.0, "inertia": (0.0, 0.0, 0.0)}),))
    assert remedies.remedy(run, remedies.SINGULAR) == (
        "nothing determines the motion of body 'bar', which has mass 0"
    )


@pytest.mark.parametrize(
    ("trial", "advice"),
    [(None, remedies.FOLLOWS), (True, remedies.COMPLETES), (False, "")],
    ids=["no trial", "it completes", "it fails"],
)
def test_taylor_is_advised_unless_its_trial_fails(monkeypatch, trial, advice):
    made = None if trial is None else SimpleNamespace(completed=trial)
    monkeypatch.setattr(remedies, "trial_of", lambda run: made)
    for status in (*STEPS, remedies.LEFT_MOTION, remedies.SINGULAR, remedies.NOT_CONVERGED):
        assert remedies.remedy(failed(), status) == advice, status
    assert remedies.remedy(failed(is_series=True), remedies.LEFT_MOTION) == advice * (trial is not None)
    assert remedies.remedy(failed("alf"), remedies.NOT_CONVERGED) == (
        remedies.COMPLETES if trial else "mpi-svd and mpi-qr solve without iteration"
    )


def test_remedies_that_need_no_trial():
    assert remedies.remedy(failed(), remedies.VIOLATED) == "+projection corrects violations after every step"
    assert remedies.remedy(failed(), 10) == "" == remedies.remedy(failed(loops=False), remedies.SINGULAR)
    for run in (failed(is_series=True), failed(loops=False)):
        assert {remedies.remedy(run, status) for status in STEPS} == {
            "mbref diagnose prints the distance of the motion from singular positions"
        }


def test_formulations_that_bear_what_a_singular_matrix_is_due_to(monkeypatch):
    monkeypatch.setattr(remedies, "trial_of", lambda run: None)
    known = [f for f in remedies.FORMULATIONS.values() if not f.needs_independent_columns]

    def listed(able: list[str]) -> str:
        return f"{', '.join(able[:-1])} or {able[-1]}" if len(able) > 1 else f"use {able[0]}"

    slender = failed("lm2")
    slender.model.mass = np.array([1.0, 1.0, 1.0, 0.0, 1.0, 1.0])
    assert remedies.remedy(slender, remedies.SINGULAR) == (
        "body 'bar' lacks mass or a moment of inertia; use "
        + listed([f.name for f in known if f.handles_singular_mass])
    )
    monkeypatch.setattr(remedies, "counts", lambda scene: SimpleNamespace(redundant=2, rows=7))
    assert remedies.remedy(failed(), remedies.SINGULAR) == (
        "constraint rows are redundant (2 of 7); use "
        + listed([f.name for f in known if f.handles_redundancy])
    )
    assert remedies.remedy(slender, remedies.SINGULAR).endswith(
        listed([f.name for f in known if f.handles_singular_mass and f.handles_redundancy])
    )


def test_titles_of_pictures():
    """The first of several lines is bold; lines are 1.4 letters or more apart, in the middle of the panel."""
    grid = SimpleNamespace(form=SimpleNamespace(letters=10, width=200.0), corner=lambda k: (300.0 * k, 5.0))
    panels = [SimpleNamespace(title=["one", "two"]), SimpleNamespace(title=["alone"])]
    first, second, alone = picture._titles(panels, grid)
    assert 'font-weight="600"' in first and "font-weight" not in second + alone
    assert [re.search(r'x="([\d.]+)"', text)[1] for text in (first, second, alone)] == [
        "100.0",
        "100.0",
        "400.0",
    ]
    heights = [float(re.search(r' y="([\d.]+)"', text)[1]) for text in (first, second, alone)]
    assert heights == pytest.approx(
        [5 + 10 * picture.LEADING, 5 + 20 * picture.LEADING, 5 + 10 * picture.LEADING]
    )


def test_a_run_without_samples_has_arrays_of_its_bodies():
    lost = Trajectory.failed(
        scene="s",
        engine="e",
        version="1",
        method="m",
        settings={},
        bodies=("a", "b"),
        outcome=Outcome.CRASHED,
        message="it failed",
    )
    shapes = [
        a.shape for a in (lost.times, lost.position, lost.orientation, lost.velocity, lost.angular_velocity)
    ]
    assert shapes == [(0,), (0, 2, 3), (0, 2, 4), (0, 2, 3), (0, 2, 3)]


WAVY = ((0.0, 0.0), (1.0, 1.0), (2.0, 8.0), (3.0, 27.0), (4.0, 64.0))  # t³


def test_pieces_of_a_switched_table():
    """The spline through t³ is t³; at 0.5 it is 0.125 + 0.75 s + 1.5 s² + s³."""
    factor = Factor(table=WAVY, start=0.5, stop=2.5)
    begins = [piece.begin for piece in factor.pieces()]
    assert begins == [0.0, 0.5, 1.0, 2.0, 2.5, 3.0]
    assert [piece.part for piece in factor.pieces()] == [0, 1, 1, 1, 0, 0]
    assert factor.pieces()[1].cubic == pytest.approx((0.125, 0.75, 1.5, 1.0))
    assert factor.pieces()[3].cubic == pytest.approx((8.0, 12.0, 6.0, 1.0))
    times = np.array([0.0, 0.49, 0.5, 1.5, 2.4, 2.5, 4.0])
    assert factor.values(times) == pytest.approx([0.0, 0.0, 0.125, 3.375, 13.824, 0.0, 0.0])
    assert Factor(table=WAVY).values(np.array([3.5, 5.0])) == pytest.approx([42.875, 125.0]), (
        "t³ beyond its end"
    )


def test_a_factor_is_one_unless_a_function_is_given():
    times = np.array([0.0, 1.0])
    assert Factor().values(times).tolist() == [1.0, 1.0] and Factor().is_constant
    sine = Sine(amplitude=2.0, frequency=math.pi / 2, phase=0.0)
    assert Factor(sine=sine).values(times) == pytest.approx([0.0, 2.0])
    assert Factor(sine=sine, polynomial=(1.0, 3.0)).values(times) == pytest.approx([1.0, 6.0])
    assert Factor(stop=0.5).values(times).tolist() == [1.0, 0.0] and not Factor(stop=0.5).is_constant
    assert not Factor(polynomial=(1.0, 2.0)).is_constant and Factor(polynomial=(1.0, 0.0)).is_constant
    assert not Factor(sine=sine).is_constant and not Factor(table=WAVY).is_constant


TEXT = """name = "s"
[[body]]
name = "crank"
mass = 1.0

[[body]]
name = "rod"
[[joint]]
name = "A"
axis = [0, 0, 1]
[[driver]]
joint = "A"
[output]
samples = 3
"""


@pytest.mark.parametrize(
    ("fault", "line"),
    [
        ("body[crank].mass: bad", 4),
        ("body[rod].mass: missing", 6),
        ("body[0].mass: bad", 4),
        ("body[1]: bad", 6),
        ("joint[A].axis: bad", 10),
        ("driver[A].joint: bad", 12),
        ("driver[A].polynomial: missing", 11),
        ("name: bad", 1),
        ("output: bad", 13),
        ("body[nobody].mass: bad", None),
        ("gravity: bad", None),
        ("joint[A].axis: bad (line 7)", 7),
    ],
)
def test_faults_name_the_line_of_their_field(fault, line):
    [text] = with_lines(TEXT, [fault])
    assert text == (fault if line is None or "(line" in fault else f"{fault} (line {line})")


def test_hints_of_the_reader():
    assert toml_hint("a = 1\n [joint]\n", "Invalid at line 1") == (
        "; line 2: [joint] must be [[joint]], one for each joint"
    )
    long = "x" * 90
    assert toml_hint(f"a = 1\n  {long}\n", "Invalid (at line 2, column 3)") == f": {long[:80]}"
    assert toml_hint("a = 1\n", "Invalid (at line 2)") == toml_hint("a = 1\n", "Invalid") == ""
    assert toml_hint("a = 1\n", "Invalid (at line 1)") == ": a = 1"


def test_pictures_of_a_film_have_whole_blocks():
    image = np.arange(5 * 17 * 3, dtype=np.uint8).reshape(5, 17, 3)
    padded = film._padded(image)
    assert padded.shape == (16, 32, 3) and (padded[:5, :17] == image).all()
    assert (padded[5:] == 255).all() and (padded[:, 17:] == 255).all()
    assert film._padded(np.zeros((16, 32, 3), np.uint8)).shape == (16, 32, 3)


def test_modes_of_the_first_stable_equilibrium_or_of_the_one_that_is_asked(monkeypatch, capsys, tmp_path):
    found = [rest([2.0, -2.0]), rest([3j, -3j]), rest([5j, -5j])]
    monkeypatch.setattr("mbref.design.equilibrium.equilibria", lambda scene, starts: found)
    drawn = []
    monkeypatch.setattr(
        "mbref.design.equilibrium.motion_of_mode", lambda each, mode: drawn.append((each, mode))
    )
    monkeypatch.setattr(statics, "write_film", lambda path, *_: path.write_text("film"))
    assert main(["modes", "four_bar_gravity", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["number"] == 2 and record["frequencies"] == [pytest.approx(3 / (2 * math.pi))] and not drawn
    picture = tmp_path / "a.svg"
    asked_for = ["modes", "four_bar_gravity", "--number", "3", "--mode", "2", "--out"]
    assert main([*asked_for, str(picture)]) == 0
    assert drawn == [(found[2], 2)] and picture.read_text() == "film"
    out = capsys.readouterr().out
    assert out.startswith("equilibrium 3: stable") and out.endswith(f"{picture}\n")
    assert main([*asked_for, str(tmp_path / "a.gif")]) == 0 and (tmp_path / "a.gif").read_text() == "film"
    del found[1:]
    capsys.readouterr()
    assert main(["modes", "four_bar_gravity", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["number"] == 1, "none is stable"


def test_equilibria_that_are_printed_and_saved(monkeypatch, capsys, tmp_path):
    found = [rest([2.0, -2.0]), rest([3j, -3j])]
    monkeypatch.setattr("mbref.design.equilibrium.equilibria", lambda scene, starts: found)
    assert main(["equilibrium", "four_bar_gravity"]) == 0
    out = capsys.readouterr().out
    assert out.count("equilibrium 1: unstable") == out.count("equilibrium 2: stable") == 1
    assert " ".join(out.split()).endswith(statics.LIMITS)
    place = tmp_path / "rest.toml"
    assert main(["equilibrium", "four_bar_gravity", "--number", "2", "--out", str(place)]) == 0
    out = capsys.readouterr().out
    assert "equilibrium 1" not in out and out.endswith(f"{place}\n") and "Other equilibria" not in out
    assert Scene.from_file(place) == found[1].scene
    assert main(["equilibrium", "four_bar_gravity", "--json", "--out", str(place)]) == 0
    assert len(json.loads(capsys.readouterr().out)["equilibria"]) == 2
    assert main(["equilibrium", "four_bar_gravity", "--out", "rest.txt"]) == 2
    assert "--out: must end in .toml, got 'rest.txt'" in capsys.readouterr().err
