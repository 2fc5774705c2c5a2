"""Motions for pictures: runs that are repeated, their poses and digits, and branches by closed forms."""

import math

import numpy as np
import pytest

from crosscheck.cli import main
from crosscheck.engine import Setting
from crosscheck.setting import BRANCHES
from crosscheck.study.grid import Case, run_case
from crosscheck.study.pictures import DIGITS, FRAMES, branches, shortened, shown, worst_runs
from mbref.scenes import SCENES

RATE = 124.8  # rad/s, of the driven crank
RHOMBUS = SCENES["four_bar"]().with_(duration=0.05)


@pytest.fixture(scope="module")
def run():
    case = Case(RHOMBUS, np.linspace(0.0, 0.05, 3), "mbref", Setting("taylor", {"rtol": 1e-9}))
    return case, run_case(case)


def test_runs_along_both_branches_part_at_the_crossing(run, tmp_path):
    """The second flat position of the rhombus is at θ = -π, t = 1.5 π / 124.8 s. From there the coupler goes
    on parallel to the ground (centre at twice the crank's centre + 0.25 m), or folds onto the crank. Frames
    begin halfway from the first flat position, at t = 0.5 π / 124.8 s. Poses have six digits of 0.75 m."""
    found = branches([run], tmp_path / "branches.jsonl")
    asked = [record["asked"]["options"] for record in found]
    assert asked == [{"rtol": 1e-9, BRANCHES: [[2, branch]]} for branch in (1, 2)]
    smooth, fold = (np.array(record["bodies"]["coupler"]["position"]) for record in found)
    times = np.array(found[0]["times"])
    crossing = 1.5 * math.pi / RATE
    assert len(times) == FRAMES and times[0] == pytest.approx(math.pi / RATE) and times[-1] == 0.05
    crank = 0.25 * np.exp(1j * (math.pi / 2 - RATE * times))
    along_crank = np.column_stack([crank.real, crank.imag, 0 * times])
    assert np.abs(smooth - (2 * along_crank + [0.25, 0.0, 0.0])).max() < 1e-6
    assert np.abs(fold - np.where((times > crossing)[:, None], along_crank, smooth)).max() < 1e-6


def test_stored_runs_along_branches_are_not_made_again(run, tmp_path):
    """The second call returns the stored records, and adds none to their file."""
    found = branches([run], tmp_path / "branches.jsonl")
    stored = (tmp_path / "branches.jsonl").read_text()
    assert branches([run], tmp_path / "branches.jsonl") == found
    assert (tmp_path / "branches.jsonl").read_text() == stored


def test_worst_run_is_shown_by_its_poses_alone(run):
    """The run of largest error is drawn at the truth's times, without rates; a crashed run has no poses."""
    case, record = run
    worse = {**record, "metrics": {**record["metrics"], "error": 1.0}}
    coarse = case._replace(setting=Setting("taylor", {"rtol": 1e-3}))
    truth = {"scene": RHOMBUS.name, "motion": {"times": [0.0, 0.01]}}
    (kept,) = worst_runs([run, (coarse, worse)], [truth], None)
    assert kept["asked"]["options"] == {"rtol": 1e-3} and kept["times"] == [0.0, 0.01]
    assert set(kept["bodies"]["crank"]) == {"position", "orientation"} and "reactions" not in kept
    assert not worst_runs([(case, {**record, "outcome": "CRASHED"})], [truth], None)


def test_shown_numbers_have_six_digits_of_the_largest():
    """123.456789012 m and 1e-9 m in one array are 123.457 m and 0; an empty array stays empty."""
    exact = {"a": {"position": [[123.456789012, 1e-9, 0.0]], "orientation": [[1.0, 0.0, 0.0, 0.0]]}}
    assert shortened(exact)["a"]["position"] == [[123.457, 0.0, 0.0]] and DIGITS == 6
    empty = {"a": {"position": np.zeros((0, 3)), "orientation": np.zeros((0, 4))}}
    assert shortened(empty) == {"a": {"position": [], "orientation": []}}


def test_crossings_with_several_branches_are_shown_instead_of_others():
    """Crossings are numbered from 1. Shown are at most two with several branches, or else the first one."""
    alone, several = {"velocity": [1]}, {"velocity": [1, 2]}
    assert shown([alone, several, several, several]) == [2, 3]
    assert shown([alone, alone]) == [1]


def test_run_takes_an_option_that_its_sweep_does_not_vary(capsys):
    """Option branches of taylor names the branch to take at a crossing; settings of a sweep have no such
    option. ``crosscheck run`` accepts it, and its printed record repeats it: branch 2 at crossing 2."""
    asked = "run four_bar --engine mbref --setting taylor --option branches=[[2,2]] --times 0.05"
    assert main([*asked.split(), "--json"]) == 0
    assert '"branches": [[2, 2]]' in capsys.readouterr().out
