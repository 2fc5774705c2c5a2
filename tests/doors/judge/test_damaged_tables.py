"""Damaged tables of a rod that turns by 16 t rad are off, or refused with one sentence and exit status 2."""

import codecs
from pathlib import Path

import numpy as np
import pytest

import crosscheck
from crosscheck.cli import main
from mbref.scene import SceneError
from tests.helpers.tables import spinning_rod

HEAD = "time,A.angle,A.rate"
TIMES = [f"{k / 8:g}" for k in range(9)]


def rows(cell: str, at: int | None = None, rate: str = "16") -> str:
    """Return a table of the rod with a cell in each row, or in one row among exact ones."""
    exact = [f"{2 * k}" for k in range(9)]
    cells = [cell if at is None or k == at else exact[k] for k in range(9)]
    return "\n".join([HEAD, *(f"{t},{c},{rate}" for t, c in zip(TIMES, cells, strict=True))])


OFF = {
    "zeros": rows("0", rate="0"),
    # 16 t rad read as degrees are below 0.06 rad, about the rounding of the zeros
    "zeros with a decimal": "\n".join(["time,A.angle", *(f"{k / 25:.2f},0.0" for k in range(6))]),
    "huge numbers": rows("1e308"),
    "huge numbers of both signs": "\n".join(
        [HEAD, *(f"{t},{'-' * (k % 2)}1.7e308,16" for k, t in enumerate(TIMES))]
    ),
    "one huge number": rows("1e308", at=3),
    "the least numbers": rows("4.9e-324"),
    "one row": f"{HEAD}\n0,1,1",
}
REFUSED = {
    "a cell of 200 000 digits": (rows("0." + "1" * 200_000, at=2), "is no table of numbers: field larger"),
    "a cell of 2 000 digits": (rows("0." + "1" * 2_000, at=2), "column 2 of row 3 has 2002 characters"),
    "more than the largest double": (rows("1e999", at=2), "row 3 is not finite"),
    "not a number": (rows("nan", at=2), "row 3 is not finite"),
    "infinite": (rows("-inf", at=0), "row 1 is not finite"),
    "not a number in the first cell": ("A.angle,time\nnan,0\n8,0.5", "row 1 is not finite"),
    "underscores": (rows("1_0", at=1), "row 2 of numbers is not 3 numbers: '1_0'"),
    "hexadecimal": (rows("0x10", at=1), "row 2 of numbers is not 3 numbers: '0x10'"),
    "empty": ("", "has no row of numbers"),
    "blanks": ("\n \n", "has no row of numbers"),
    "a header alone": (HEAD, "has no row of numbers"),
    "two columns of one name": ("time,A.angle,A.angle\n0,0,0", "columns 2 and 3 are both A.angle"),
    "two columns of times": ("time,t,A.angle\n0,0,0", "columns 1 and 2 are both time"),
    "equal times": (f"{HEAD}\n0,0,16\n0,0,16", "times must not be negative and must increase"),
    "times far beyond the duration": (f"{HEAD}\n0,0,16\n1e308,0,16", "times end at 1e+308 s"),
    "a row that is cut": (rows("0", at=8)[:-4], "row 9 of numbers is not 3 numbers"),
    "a quote that is not closed": (f'{HEAD}\n0,"0,16\n0.5,8,16', "has no column time"),
    "a number too large for its unit": (
        "time,A.angle [rev],A.rate\n0,1e308,16\n0.5,1e308,16",
        "column A.angle: numbers are too large for its unit",
    ),
}


def status(table: bytes, folder: Path) -> int:
    """Return the exit status of the command for a table."""
    spinning_rod().save(folder / "scene.toml")
    (folder / "run.csv").write_bytes(table)
    return main(["judge", str(folder / "scene.toml"), str(folder / "run.csv")])


@pytest.mark.parametrize("name", OFF)
def test_wrong_numbers_of_any_size_are_off_and_have_no_explanation(name: str, tmp_path: Path, capsys) -> None:
    """The exact angle is 16 t rad; neither zeros, huge numbers nor the least numbers are a change of it."""
    assert status(OFF[name].encode(), tmp_path) == 1
    shown = capsys.readouterr().out
    (angle,) = (line for line in shown.splitlines() if "A.angle" in line)
    assert "off" in [cell.strip() for cell in angle.split("│")]
    assert "No single change explains the difference." in shown


@pytest.mark.parametrize("name", REFUSED)
def test_damaged_table_is_refused_with_one_sentence_on_its_damage(name: str, tmp_path: Path, capsys) -> None:
    """Standard error has one line of less than 500 characters, also for a cell of 200 000 digits."""
    table, says = REFUSED[name]
    assert status(table.encode(), tmp_path) == 2
    printed = capsys.readouterr()
    assert not printed.out and printed.err.count("\n") == 1 and len(printed.err) < 500
    assert f"run.csv: {says}" in printed.err


@pytest.mark.parametrize("seed", range(5))
def test_random_bytes_are_refused_with_one_sentence_on_the_file(seed: int, tmp_path: Path, capsys) -> None:
    """3000 random bytes are no text: the command prints one line, which names run.csv, and returns 2."""
    assert status(np.random.default_rng(seed).bytes(3000), tmp_path) == 2
    printed = capsys.readouterr()
    assert not printed.out and printed.err.count("\n") == 1 and "run.csv: " in printed.err


EXACT = rows("0", at=0)  # the angle 16 t rad and the rate 16 rad/s
WRITTEN = {
    "mark of UTF-8": EXACT.encode("utf-8-sig"),
    "UTF-16": codecs.BOM_UTF16_LE + EXACT.encode("utf-16-le"),
    "tabs": EXACT.replace(",", "\t").encode(),
    "semicolons and decimal commas": EXACT.replace(",", ";").replace("0.", "0,").encode(),
    "exponents of Fortran": rows("0.0D+00", at=0).encode(),
    "quotes": "\n".join(f'"{line}"'.replace(",", '","') for line in EXACT.splitlines()).encode(),
    "line ends of Windows": EXACT.replace("\n", "\r\n").encode(),
}


@pytest.mark.parametrize("table", WRITTEN.values(), ids=WRITTEN)
def test_exact_table_is_right_in_encodings_and_formats_of_other_programs(table, tmp_path):
    """Exit status 0 means right. Each table has the exact motion, EXACT."""
    assert status(table, tmp_path) == 0


HALF = np.array([0.0, 0.5])  # s


@pytest.mark.parametrize(
    ("motion", "says"),
    [
        ({"A.angle": HALF}, "no column time"),
        ({"time": HALF, "b.angle": HALF}, "no column of the scene"),
        ({"time": HALF, "A.angle": HALF[:1]}, "A.angle: must have one number for each time"),
        ({"time": HALF, "A.angle": HALF * np.nan}, "A.angle: is not finite"),
        ({"time": HALF[::-1], "A.angle": HALF}, "must increase"),
    ],
    ids=["no times", "no known column", "too short", "not finite", "falling times"],
)
def test_function_judge_motion_refuses_faulty_columns_with_the_fault(motion: dict, says: str) -> None:
    """The columns are arrays in Python instead of a file."""
    with pytest.raises(SceneError, match=says):
        crosscheck.judge_motion(spinning_rod(), motion)
