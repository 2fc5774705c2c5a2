"""A table of the exact motion is right in random formats of numbers; with an error of ten units it is off."""

import functools
from pathlib import Path

import numpy as np
import pytest

import crosscheck
from crosscheck.cli import main
from mbref.scene import Scene
from tests.helpers.coupled_mechanisms import body
from tests.helpers.tables import FORMATS, Table, double_pendulum, spinning_rod, write_table

SCENES = {"double_pendulum": double_pendulum, "spinning_rod": spinning_rod}
GATE, DEEP = 8, 100  # numbers of random tables for `make check` and for `make deep`
SHARE = 1e-3  # fraction of a column's range, above which the verdict "right" must state the rounding
TOLERANCE = 1e-8  # the judge's default tolerance, relative to the size of a quantity
CASES = [pytest.param(k, marks=[pytest.mark.slow] * (k >= GATE)) for k in range(DEEP)]
seeds = pytest.mark.parametrize("seed", CASES)


@functools.cache
def exact(name: str) -> Table:
    """Return the reference motion of a scene at 41 times, 0.01 s or 0.025 s apart."""
    scene = SCENES[name]()
    found = crosscheck.reference_table(scene, np.linspace(0.0, scene.duration, 41))
    return {n: c for n, c in found.items() if n != "bound"}


def random_part(seed: int) -> tuple[np.random.Generator, Scene, Table, str]:
    """Return the generator, a scene, random columns and samples of its exact motion, and a random format."""
    rng = np.random.default_rng(seed)
    name = str(rng.choice(list(SCENES)))
    table = exact(name)
    moving = [n for n in table if n != "time" and np.ptp(table[n]) > 0.01]
    columns = rng.permutation(moving)[: rng.integers(2, 9)]
    start, count = int(rng.integers(0, 20)), int(rng.integers(12, 22))
    part = {n: table[n][start : start + count] for n in ("time", *sorted(columns))}
    return rng, SCENES[name](), part, str(rng.choice(list(FORMATS)))


def unit(values: np.ndarray, form: str) -> float:
    """Return the unit of the last digit of the largest number of a column in a format."""
    count = {"repr": 16, "single precision": 7}.get(form)  # of significant digits
    if count is None and (form.endswith("f") or "decimals" in form):
        return 10.0 ** -int("".join(c for c in form if c.isdigit()))
    if count is None:
        count = int(form[2:-1]) + form.endswith("e")
    return float(10.0 ** (np.floor(np.log10(np.abs(values).max())) - count + 1))


def digits(values: np.ndarray, form: str) -> int:
    """Return the digits of the largest number down to `unit`, or to 0.1 if all are multiples of 0.1."""
    last = 0.1 if np.allclose(values, values.round(1), rtol=0.0, atol=1e-12) else 0.0
    first = 10.0 ** np.floor(np.log10(np.abs(values).max()))
    return round(np.log10(first / max(last, unit(values, form)))) + 1


@seeds
def test_an_exact_table_is_right_in_a_random_format_and_coarse_rounding_is_stated(seed, tmp_path):
    """The table is part of a reference motion, in a random format. Where the error that the judge allows
    exceeds a thousandth of a column's range, and only there, its verdict states to how many digits the
    column is rounded. A largest number such as 0.9996 may have a digit more when it is written, 1.000."""
    _, scene, table, form = random_part(seed)
    found = crosscheck.judge_motion(scene, write_table(table, tmp_path / "run.csv", FORMATS[form]))
    assert found.is_right, (form, [c for c in found.columns if not c.is_right])
    for column in found.columns:
        values = table[column.name]
        shown = np.array([float(FORMATS[form](float(x))) for x in values])
        rounded = column.bound > SHARE * np.ptp(values)
        assert column.rounded_to in ({digits(v, form) for v in (values, shown)} if rounded else {None}), form


@pytest.mark.parametrize("form", ["%.6f", "%.7f", "%.8f", "%.7g", "spreadsheet with 8 decimals"])
def test_numbers_wrong_by_half_the_tolerance_are_right_after_rounding(form: str, tmp_path: Path) -> None:
    """The judge must add both allowances: half its tolerance, 5e-9 rad, is put into each angle of the exact
    motion, and writing with few digits adds up to half a unit of the last digit."""
    rng = np.random.default_rng(6)
    table = {n: exact("double_pendulum")[n].copy() for n in ("time", "A.angle", "B.angle")}
    for name in ("A.angle", "B.angle"):
        table[name] += 0.5 * TOLERANCE * rng.choice([-1, 1], len(table["time"]))
    path = write_table(table, tmp_path / "run.csv", FORMATS[form])
    assert crosscheck.judge_motion(double_pendulum(), path).is_right


@seeds
def test_column_with_one_cell_that_is_ten_units_of_its_last_digit_wrong_is_off(seed, tmp_path):
    """One number of an exact table is changed by ten units of its last digit plus 100 tolerances."""
    rng, scene, table, form = random_part(seed)
    name = str(rng.choice([n for n in table if n != "time"]))
    size = 10 * unit(table[name], form) + 100 * TOLERANCE * max(1.0, np.abs(table[name]).max())
    table[name] = table[name].copy()
    table[name][rng.integers(len(table["time"]))] += size * rng.choice([-1, 1])
    found = crosscheck.judge_motion(scene, write_table(table, tmp_path / "run.csv", FORMATS[form]))
    assert name in [c.name for c in found.columns if not c.is_right], form


@pytest.mark.parametrize(
    "rows",
    [
        ["0,0", "0.1,-0.2", "0.2,0.3", "0.3,-0.9"],
        ["0,0.5", "0.1,0.51", "0.2,0.54", "0.3,0.6"],
        ["0.0,0.0", "0.1,1.0", "0.2,2.0", "0.3,3.0"],
    ],
    ids=["jumps", "slow", "even"],
)
def test_wrong_angles_of_one_or_two_digits_are_off(rows, tmp_path):
    """The exact angle of the double pendulum falls from 0 to -0.69 rad in 0.3 s. Half a unit of the last
    digit, 0.05 rad at most, does not explain these angles."""
    path = tmp_path / "run.csv"
    path.write_text("\n".join(["time,A.angle", *rows]), encoding="utf-8")
    assert not crosscheck.judge_motion(double_pendulum(), path).is_right


@pytest.mark.parametrize(("form", "verdict"), [("%.3f", "right, rounded to 2 digits"), ("%.12g", "right")])
def test_command_states_rounding_that_exceeds_a_thousandth_of_the_range(form, verdict, tmp_path, capsys):
    """The 12 angles go from 0 to -0.098 rad. Half a unit of three decimals, 5e-4 rad, is more than a
    thousandth (SHARE) of this range, and 0.098 has two digits; half a unit of twelve digits is less."""
    double_pendulum().save(tmp_path / "scene.toml")
    part = {n: exact("double_pendulum")[n][:12] for n in ("time", "A.angle")}
    path = write_table(part, tmp_path / "run.csv", FORMATS[form])
    assert main(["judge", str(tmp_path / "scene.toml"), str(path)]) == 0
    (row,) = [line for line in capsys.readouterr().out.splitlines() if "A.angle" in line]
    assert [cell.strip() for cell in row.split("│") if "right" in cell] == [verdict], row


def test_times_of_few_digits_are_compared_within_their_rounding_of_large_angles(tmp_path: Path) -> None:
    """The rod turns by 80 t rad. Times of three decimals are off by up to 0.5 ms, 0.04 rad, and the judge
    compares at times within this rounding: exact states are right, and an error of 1e-6 m in one column is
    not. At 16 rad/s a row at 0.33 s may be of 1/3 s, and not of 0.35 s."""
    scene, path, times = spinning_rod(), tmp_path / "run.csv", np.random.default_rng(1).uniform(0, 1, 30)
    rates = {"velocity": (0.0, 40.0, 0.0), "angular_velocity": (0.0, 0.0, 80.0)}
    fast = [b.model_copy(update=rates) for b in scene.body]
    angle = 80 * np.sort(times)
    table = {"rod.x": np.cos(angle) / 2, "rod.y": np.sin(angle) / 2, "rod.qz": np.sin(angle / 2)}
    for error, is_right in ((0.0, True), (1e-6, False)):
        table["rod.y"] = table["rod.y"] + error * (np.arange(30) == 7)
        rows = zip(angle / 80, *table.values(), strict=True)
        written = [",".join([f"{t:.3f}", *(repr(float(x)) for x in numbers)]) for t, *numbers in rows]
        path.write_text("\n".join([",".join(["time", *table]), *written]), encoding="utf-8")
        assert crosscheck.judge_motion(scene.with_(body=fast), path).is_right is is_right
    for time, is_right in ((1 / 3, True), (0.35, False)):
        path.write_text(f"time,A.angle\n0.00,0.000000\n0.33,{16 * time:.6f}\n", encoding="utf-8")
        assert crosscheck.judge_motion(scene, path).is_right is is_right


def test_wrong_column_of_a_body_that_hardly_moves_is_off_at_rounded_times(tmp_path: Path) -> None:
    """Gravity is 1e-309 m/s². Times of two digits may move within their rounding; no position needs it."""
    scene = Scene(
        name="far", gravity=(0.0, 0.0, -1e-309), duration=1.0, body=[body("a", 1.0, [1.0] * 3, (0.0,) * 3)]
    )
    path = tmp_path / "run.csv"
    for z, is_right in ((0.0, True), (1.0, False)):
        path.write_text(f"time,a.z\n0.00,{z}\n0.33,{z}\n0.34,{z}\n0.91,{z}\n", encoding="utf-8")
        assert crosscheck.judge_motion(scene, path).is_right is is_right


def test_zero_among_numbers_with_an_exponent_is_exact(tmp_path: Path) -> None:
    """A small angle in the format of 1.234e-05 has four digits. Written as 0.000e+00 it is off: this cell is
    zero, and not a number below 5e-4 that is rounded to three decimals."""
    scene, path = double_pendulum(), tmp_path / "run.csv"
    table = crosscheck.reference_table(scene, np.array([0.0, 0.005, 0.1, 0.2]))
    part = {n: table[n].copy() for n in ("time", "A.angle")}
    assert 1e-6 < abs(part["A.angle"][1]) < 4e-4
    assert crosscheck.judge_motion(scene, write_table(part, path, FORMATS["%.3e"])).is_right
    part["A.angle"][1] = 0.0
    assert not crosscheck.judge_motion(scene, write_table(part, path, FORMATS["%.3e"])).is_right


def engineering(number: float) -> str:
    """Return a number with six decimals and an exponent that is a multiple of three."""
    exponent = 3 * int(np.floor(np.log10(abs(number)) / 3)) if number else 0
    return f"{number / 10.0**exponent:.6f}E{exponent:+03d}"


@pytest.mark.parametrize("axes", ["wxyz", "z"], ids=["quaternion", "one component"])
@pytest.mark.parametrize(
    "form",
    [FORMATS["%.5f"], engineering, lambda x: f"{np.float32(x):.9g}"],
    ids=["%.5f", "engineering", "single"],
)
def test_quaternions_of_random_signs_are_right_at_rounded_times_in_any_format(form, axes, tmp_path):
    """The rod turns by 16 t rad, its centre is 0.5 m from the hinge, and times are random. Signs of
    quaternions are, too. With the opposite sign of a velocity, its column is off."""
    rng, names = np.random.default_rng(4), [f"rod.orientation.{a}" for a in axes]
    times = np.sort(rng.uniform(0.0, 1.0, 30))
    sign, angle = rng.choice([-1.0, 1.0], 30), 16 * times
    q = dict(zip("wxyz", (np.cos(angle / 2), 0 * angle, 0 * angle, np.sin(angle / 2)), strict=True))
    table = {"time": times, "A.angle": angle, "rod.velocity.x": -8 * np.sin(angle)}
    table |= {n: sign * q[n[-1]] for n in names}
    path = tmp_path / "run.csv"
    assert crosscheck.judge_motion(spinning_rod(), write_table(table, path, form)).is_right
    table["rod.velocity.x"] = -table["rod.velocity.x"]
    found = crosscheck.judge_motion(spinning_rod(), write_table(table, path, form))
    assert [c.name for c in found.columns if not c.is_right] == ["rod.velocity.x"]


@pytest.mark.parametrize("above", ["", "2026-11-29 10:30\n", "1.5.2 export\n\n"])
def test_bodies_whose_names_differ_in_case_are_told_apart_below_a_date(above: str, tmp_path: Path) -> None:
    """Bodies `2` and `rod` rest, `Rod` moves by 2 t without joints; a date or version may stand above."""
    speeds, path = {"2": 0.0, "rod": 0.0, "Rod": 2.0}, tmp_path / "run.csv"
    bodies = [body(n, 1.0, [1.0] * 3, (0, 0, 0), velocity=[v, 0, 0]) for n, v in speeds.items()]
    scene = Scene(name="free", body=bodies)
    rows = "2.x,Rod.x,rod.x,time\n0.0000,0.0000,0.0000,0\n0.0000,1.0000,0.0000,0.5\n"
    path.write_text(above + rows, encoding="utf-8")
    found = crosscheck.judge_motion(scene, path)
    assert found.is_right and {c.name.partition(".")[0] for c in found.columns} == {"2", "Rod", "rod"}


def test_rows_after_the_end_of_the_reference_are_not_right(tmp_path: Path, capsys) -> None:
    """The pendulum starts at rest, so that its angle is below 1e-4 rad in the first 2 ms. One CPU s reaches
    some of its 1000 s, also on slow processors. The invented last row makes the exit status 1."""
    double_pendulum().with_(duration=1000.0).save(tmp_path / "scene.toml")
    path = tmp_path / "run.csv"
    rows = "time,A.angle\n0,0.000000\n0.001,0.000000\n0.002,0.000000\n1000,7.000000\n"
    path.write_text(rows, encoding="utf-8")
    limits = ["--reference-time", "1", "--tolerance", "1e-4"]
    assert main(["judge", str(tmp_path / "scene.toml"), str(path), *limits]) == 1
    shown = " ".join(capsys.readouterr().out.split())
    assert "right, rounded to 7 digits, to 0.002 s" in shown and "later rows are not judged" in shown
