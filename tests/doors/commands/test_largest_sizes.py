"""Sizes of scenes and runs that no machine has are refused before anything is built."""

import signal
from collections.abc import Iterator

import numpy as np
import pytest

from crosscheck.cli import main as crosscheck
from mbref import find_scene, simulate
from mbref.cli import main
from mbref.equations.model import Model
from mbref.input_error import InputError
from mbref.kernels.compilation import CACHE
from mbref.linear_algebra.symbolic_factorisation import symbolic_factorisation
from mbref.scene import Scene
from tests.helpers.statics import hinge, rod

HUGE = "9" * 20
COMMANDS = [
    *((main, ["run"]), (main, ["diagnose"]), (main, ["draw"]), (main, ["animate"]), (main, ["plot"])),
    *((main, ["assemble"]), (main, ["equilibrium"]), (main, ["modes"])),
    *((main, ["ensemble", "--vary", "gravity[1]=0:1"]), (main, ["export", "--out", "new.xml"])),
    *((crosscheck, ["run"]), (crosscheck, ["compare"]), (crosscheck, ["tune", "mbref"])),
    *((crosscheck, ["modes"]), (crosscheck, ["reference", "--out", "new.csv"])),
]


@pytest.fixture
def ten_seconds() -> Iterator[None]:
    """Let the test fail after 10 CPU s: a scene that is not refused would be built for hours."""

    def end(*_: object) -> None:
        raise AssertionError("not refused within 10 CPU s")

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, 10.0)
    yield
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    signal.signal(signal.SIGPROF, before)


@pytest.mark.usefixtures("ten_seconds")
@pytest.mark.parametrize(("program", "words"), COMMANDS, ids=lambda x: x[0] if isinstance(x, list) else "")
@pytest.mark.parametrize("chain", ["four_bar_chain", "slider_crank_chain"])
def test_chain_of_too_many_loops_is_refused_unwritten(program, words, chain, tmp_path, monkeypatch, capsys):
    """The number of loops has 20 digits; a scene with so many would fill every memory."""
    monkeypatch.chdir(tmp_path)
    assert program([*words, f"{chain}[{HUGE}]"]) == 2
    assert f"{chain}[{HUGE}]: must have at most 10000 loops" in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


STATES = 10_000_000  # largest number of samples times bodies of runs, which take about 2 GB


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("run four_bar_chain[100] --samples", f"{STATES // 201} for 201 bodies"),
        ("ensemble four_bar --vary gravity[1]=0:1 --count", f"{STATES // (3 * 101)}"),
    ],
)
def test_more_states_than_memory_holds_are_refused_with_the_largest_number(words, says, capsys):
    """The chain has 201 bodies; a four-bar has three, and a run of an ensemble 101 samples."""
    assert main([*words.split(), "1000000"]) == 2
    assert f"{words.split()[-1]}: must be at most {says}" in capsys.readouterr().err


def test_full_matrix_beyond_the_memory_of_the_machine_is_refused_with_its_size():
    """Two hinges with 5 rows, two universal joints with 4 and a driver have 19 rows. For 10⁹ poses, 19 rows
    and 24 columns of 8 bytes take 3648 GB: 18 columns of three bodies, and six of the ground, which are left
    out later. The blocks that are given are views of one block, which take no memory."""
    structure = Model(find_scene("four_bar")).structure
    one = np.zeros(structure.entry_columns.shape)
    with pytest.raises(InputError, match=r"of 19 constraint rows and 18 columns takes 3\.65e\+03 GB"):
        structure.dense(np.broadcast_to(one, (10**9, *one.shape)))


def test_factorisation_of_500_rows_on_one_coordinate_is_refused_before_its_updates_take_2_gigabytes():
    """Each of n rows depends on each: n (n² - 1) / 6 = 20 833 250 updates, of 20 million allowed."""
    row, column = np.arange(500), np.zeros(500, dtype=int)
    with pytest.raises(InputError, match=r"500 constraint rows share bodies.* has 20833250 updates"):
        symbolic_factorisation(row, column, row, np.ones(1, dtype=bool))


LARGEST_FILE = 2**25  # bytes, 32 MB, of a factorisation in the cache


def test_factorisation_of_480_rows_on_one_coordinate_leaves_no_file_above_32_mb_in_the_cache():
    """The factorisation's lists of indices, of 4 bytes each, take more than the largest file. One of 3 rows
    leaves a file, so that the cache is not empty. A file has a checksum of less than 1 % more."""
    for count in (3, 480):
        row, column = np.arange(count), np.zeros(count, dtype=int)
        made = symbolic_factorisation(row, column, row, np.ones(1, dtype=bool))
    assert 4 * sum(array.size for array in made) > LARGEST_FILE
    sizes = [path.stat().st_size for path in CACHE.glob("patterns/*")]
    assert sizes and max(sizes) < 1.01 * LARGEST_FILE


@pytest.mark.slow
def test_door_on_150_hinges_moves_as_on_one_hinge():
    """All hinges are on one axis: of their 750 rows, 745 are redundant. Within a second, the penalty of
    redundant rows and the default tolerance leave differences below 1e-6 m."""
    hinges, body = [hinge(f"h{k}", ("ground", "door"), (0, 0, k)) for k in range(150)], rod("door", (1, 0, 0))
    door = Scene(name="door", gravity=(0.0, -9.81, 0.0), body=[body], joint=hinges)
    scenes = door, door.with_(joint=hinges[:1])
    many, one = (simulate(scene, times=[0.0, 0.5, 1.0]).position for scene in scenes)
    assert many == pytest.approx(one, abs=1e-6)
