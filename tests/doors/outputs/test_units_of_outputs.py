"""Outputs in requested units, largest reactions with their times, and plots over the angle of a driver."""

import math

import numpy as np
import pytest
from matplotlib.figure import Figure

import mbref
from crosscheck.recorded.reading import read
from mbref.cli import main
from tests.helpers.parts import Z, joint

MASS, RADIUS, RATE, G = 2.0, 0.25, 2 * math.pi, 9.81
TIMES = np.linspace(0.0, 1.0, 9)
SIZES = {  # unit of an output → its size in SI, by "mm,deg,kN,ms"
    **{"ms": 1e-3, "mm": 1e-3, "mm/s": 1e-3, "mm/s²": 1e-3, "deg": math.pi / 180, "deg/s": math.pi / 180},
    **{"deg/s²": math.pi / 180, "kN": 1e3, "kN mm": 1.0, "W": 1.0, "J": 1.0},
}


def crank(rate=RATE, size=1.0):
    """A mass on a crank of ``size`` that turns once a second, level at the start, in the plane of gravity."""
    mass = {"mass": MASS * size**3, "inertia": [0, 0, 0], "position": [RADIUS * size, 0, 0]}
    driver = {"joint": "A", "polynomial": [0, rate]}
    pivot = joint("A", "revolute", "ground", "mass", axis=Z)
    given = {"body": [{"name": "mass", **mass}], "joint": [pivot], "driver": [driver]}
    return mbref.Scene(name="crank", gravity=(0, -G, 0), **given)


@pytest.fixture(scope="module")
def motion():
    return mbref.simulate(crank(), times=TIMES)


def test_columns_in_other_units_times_the_size_of_the_unit_are_the_si_columns(motion):
    """SIZES has the SI size of each unit: torques follow from the units of force and length, powers and
    energies keep their own. Conversion costs a few roundings. One turn a second is 60 rpm, and a unit such
    as N mm can be given for one quantity."""
    plain, converted = motion.columns(), motion.columns(units="mm,deg,kN,ms")
    assert len(plain) == len(converted)
    for (name, values), (header, others) in zip(plain.items(), converted.items(), strict=True):
        column, bracket, unit = header.removesuffix("]").partition(" [")
        assert column == name
        if "violation" not in name:  # of rows of several units
            assert np.allclose(others * (SIZES[unit] if bracket else 1.0), values, rtol=1e-15, atol=0)
    assert motion.columns("A.rate", units="rpm")["A.rate [rpm]"] == pytest.approx(60.0, rel=1e-13)
    assert list(motion.columns("A.moment.z", units="N mm,m")) == ["time [s]", "A.moment.z [N mm]"]


@pytest.mark.parametrize(
    ("units", "message"),
    [("mn", "'mn' is no unit"), ("mm,cm", "'mm' and 'cm' are units of one"), ("kg", "no number of a motion")],
)
def test_units_that_no_output_can_have_are_refused(motion, units, message, capsys):
    """Method and command refuse an unknown unit, two units of one quantity, and a unit of mass."""
    with pytest.raises(mbref.InputError, match=f"units: .*{message}"):
        motion.columns(units=units)
    with pytest.raises(SystemExit, match="2"):
        main(["run", "four_bar", "--units", units])
    assert message in capsys.readouterr().err


def test_decimal_commas_without_a_spreadsheet_to_write_are_refused(capsys):
    """Decimal commas are of CSV files; this table would be printed."""
    assert main(["run", "four_bar", "--decimal-comma", "--columns", "energy"]) == 2
    assert "--decimal-comma: needs --out FILE.csv" in capsys.readouterr().err


def test_spreadsheet_with_decimal_commas_is_read_with_the_values_of_the_motion(motion, tmp_path):
    """The judge's reader takes units from the headers. Conversion of units costs some roundings."""
    roundings = 1e-14  # relative
    motion.to_csv(tmp_path / "crank.csv", units="mm,deg,kN,ms", decimal_comma=True)
    text = (tmp_path / "crank.csv").read_text(encoding="utf-8-sig").splitlines()
    assert text[0].startswith("time [ms];mass.orientation.w;") and "." not in text[2]
    recording = read(tmp_path / "crank.csv", crank(), {})
    assert np.allclose(recording.times, TIMES, rtol=roundings, atol=0)
    for name, values in recording.columns.items():
        assert np.allclose(values, motion.columns()[name], rtol=roundings, atol=0), name
    assert {"mass.acceleration.y", "A.angle", "A.force.x", "driver(A).torque"} <= set(recording.columns)


def test_largest_reaction_of_a_crank_is_at_the_bottom(motion):
    """The force is m (ω² r + g) at the bottom, after three quarters of a turn at 0.75 s. The largest moment
    is the driver's torque m g r where the crank is level, at 0, 0.5 or 1 s. The driver prescribes the motion,
    so that all is exact to rounding."""
    found = motion.reaction_maxima()["A"]
    assert found.force == pytest.approx(MASS * (RATE**2 * RADIUS + G), rel=1e-12)
    assert found.force_time == 0.75 and found.open == 0
    assert found.moment == pytest.approx(MASS * G * RADIUS, rel=1e-12)
    assert found.moment_time in (0.0, 0.5, 1.0)


@pytest.mark.parametrize("size", [1.0, 1e-6])
def test_command_prints_largest_reactions_and_their_times_in_the_requested_units(size, tmp_path, capsys):
    """Printed are the crank's moment m g r in N mm, and its force m (ω² r + g) in N at 750 ms; at the start
    the driver's power is m g r ω. A crank of micrometres has no number that counts as a rounding error."""
    crank(size=size).save(tmp_path / "crank.toml")
    command = ["run", str(tmp_path / "crank.toml"), "--samples", "9", "--maxima", "--units", "N mm,mm,ms"]
    assert main([*command, "--columns", "driver(A).power", "mass.position.z"]) == 0
    shown = capsys.readouterr().out
    mass, radius = MASS * size**3, RADIUS * size
    force = mass * (RATE**2 * radius + G)
    assert f"{1000 * mass * G * radius:.6g}" in shown and f"{force:.6g} │  750 " in shown
    assert f"│  0 │ {mass * G * radius * RATE:.6g} │".replace(" ", "") in shown.replace(" ", "")


def test_plot_over_the_angle_of_a_driver_has_the_columns_as_curves(motion):
    """At the time t the angle is 360 t degrees, and y = 250 sin 2π t mm is the second curve of the panel."""
    figure = motion.plot("mass.position", "A.angle", over="A.angle", units="mm,deg")
    panel, lowest = figure.axes
    assert lowest.get_xlabel() == "A.angle, deg" and panel.get_ylabel() == "position, mm"
    assert np.allclose(panel.lines[1].get_xdata(), 360 * TIMES, rtol=0, atol=1e-9)  # degrees
    assert np.allclose(panel.lines[1].get_ydata(), 250 * np.sin(RATE * TIMES), rtol=0, atol=1e-9)  # mm


@pytest.mark.parametrize(
    ("together", "labels"),
    [(False, ["moment, N m", "torque, N m", "rate, rad/s"]), (True, ["N m", "rate, rad/s"])],
)
def test_columns_of_one_unit_share_a_panel_on_request(motion, together, labels):
    """A moment and a torque have the unit N m, a rate has another one; the request is ``together``."""
    panels = motion.plot("A.moment.z", "driver(A).torque", "A.rate", together=together).axes
    assert [panel.get_ylabel() for panel in panels] == labels
    assert sum(len(panel.lines) for panel in panels) == 3


def test_several_motions_are_drawn_into_given_axes(motion):
    """Curves that are there stay, a label follows a column's name; 30 rpm turns half as far as 60 rpm."""
    slow = mbref.simulate(crank(rate=math.pi), times=TIMES)
    ax = Figure().subplots()
    ax.plot([0, 1], [0, 1], label="by hand")
    assert mbref.plot({"60 rpm": motion, "30 rpm": slow}, "A.angle", ax=ax) is ax
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == ["by hand", "A.angle, 60 rpm", "A.angle, 30 rpm"]
    assert np.allclose(ax.lines[2].get_ydata(), ax.lines[1].get_ydata() / 2, rtol=1e-14, atol=0)


def test_two_quantities_for_given_axes_or_three_columns_as_abscissa_are_refused(motion):
    """Axes have one unit; ``over`` takes one column of all motions, and a position has three."""
    with pytest.raises(mbref.InputError, match="ax: takes columns of one quantity"):
        motion.plot("A.angle", "A.rate", ax=Figure().subplots())
    with pytest.raises(mbref.InputError, match="over: must be one column"):
        motion.plot("A.angle", over="mass.position")
    free = mbref.simulate(crank().with_(joint=[], driver=[], gravity=[1, 0, 0]), times=TIMES[:2])
    with pytest.raises(mbref.InputError, match=r"over: motion 'free' has no column 'A\.angle'"):
        mbref.plot({"crank": motion, "free": free}, "mass.position.x", over="A.angle")
