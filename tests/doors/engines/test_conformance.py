"""Conformance suite: its exact motions against the judge, and its verdicts on engines with known faults."""

import contextlib
import io
import json
import signal

import numpy as np
import pytest
from rich.console import Console

from crosscheck.cli.commands import main
from crosscheck.conformance import suite, trial
from crosscheck.conformance.changes.relations import shaken
from crosscheck.conformance.mechanisms.closed_forms import GEARED
from crosscheck.conformance.mechanisms.features import undetermined
from crosscheck.conformance.mechanisms.specimens import specimens
from crosscheck.conformance.runners import InProcess, Isolated
from crosscheck.engine import engine
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.truth import truth_for
from mbref.motions.trajectory import Outcome
from tests.helpers.fake_engines import FAKES, Fake

ROUNDING = 1e-13  # m or rad; 1e-16 is measured
SPECIMENS = {specimen.scene.name: specimen for specimen in specimens()}


def test_formulas_of_the_suite_equal_the_judges_truth():
    """The suite's formulas differ from the judge's solutions of equations of motion by less than 1e-13."""
    for name in ("free_fall", "oscillator", "torsion", "driven", "pendulum", "turntable"):
        specimen = SPECIMENS[name]
        solved, times = truth_for(specimen.scene), np.linspace(0, specimen.scene.duration, 7)
        written = trial.exact_motion(specimen, times)
        apart = trial.difference(specimen.scene, written, solved.poses(times))
        assert apart < ROUNDING, f"{name}: formula and {solved.name} differ by {apart:.3g}"


@pytest.mark.parametrize("make", GEARED, ids=lambda make: make.__name__)
def test_formulas_of_geared_mechanisms_equal_the_reference(make):
    """Both differ by less than 1e-13. The reference has long doubles; signs of quaternions are free."""
    scene, exact = make()
    times = np.linspace(0, scene.duration, 4)
    position, orientation = exact(times)
    found = natural_motion(scene, times, EXTENDED, seconds=60.0)
    assert np.abs(position - doubles(found.position)).max() < ROUNDING
    turned = np.abs(np.einsum("kbi,kbi->kb", orientation, doubles(found.orientation)))
    assert np.abs(turned - 1).max() < ROUNDING


def test_verify_fails_an_engine_that_prints_and_rests_where_a_body_falls(capsys):
    """CHATTER prints, does not move, and refuses no scene, even one whose motion is undetermined: the checks
    of silence, truth and that refusal fail. Its times, quaternions and processes are right."""
    status = main(["verify", f"{FAKES}:CHATTER", "--scene", "free_fall", "--json"])
    record = json.loads(capsys.readouterr().out)
    verdicts = {v["property"]: v["status"] for v in record["verdicts"] if v["scene"] == "free_fall"}
    faulty = {name for name, verdict in verdicts.items() if verdict == "fail"}
    assert (status, record["conforms"]) == (1, False), (status, record["conforms"])
    assert {"silence", "truth"} <= faulty, verdicts
    assert {"times", "unit", "run"}.isdisjoint(faulty), verdicts
    undone = [v for v in record["verdicts"] if v["scene"] == undetermined().name]
    assert [v["status"] for v in undone] == ["fail"], undone


def test_an_endless_run_in_this_process_times_out_and_leaves_no_timer():
    """The engine loops for ever and catches every Exception. Its run ends after 0.1 s, and the next run, of
    another scene, completes within a limit of 0.1 s of its own."""

    class Endless(Fake):
        def act(self, scene):
            while scene.name == "endless":
                with contextlib.suppress(Exception):
                    sum(range(1000))

    scene = SPECIMENS["free_fall"].scene
    bench, times = InProcess(Endless(), "", 0.1), np.array([0.0, 0.1])
    setting = Endless().settings(scene)[0]
    before = signal.getsignal(signal.SIGPROF)
    ended = bench.observe(scene.with_(name="endless"), times, setting).value
    assert ended.outcome is Outcome.TIMED_OUT and ended.message == "no result after 0.1 s"
    assert bench.observe(scene, times, setting).value.outcome is Outcome.COMPLETED
    assert signal.getsignal(signal.SIGPROF) == before and signal.getitimer(signal.ITIMER_PROF) == (0.0, 0.0)


@pytest.mark.parametrize(("fake", "status"), [("FAKE", "pass"), ("AGING", "fail"), ("KEEPING", "fail")])
def test_check_repeated_fails_only_engines_whose_runs_depend_on_earlier_runs(fake, status):
    """AGING moves bodies by 1e-14 m more in every run of a process, KEEPING by 1e-14 m for a kg of the first
    run, and FAKE not. A new process repeats the first run, so that the check `reordered` passes."""
    bench = trial.set_up(Isolated(f"{FAKES}:{fake}", 60.0), SPECIMENS["pendulum"])
    repeated, reordered = (suite.verdict_on(check, bench) for check in ("repeated", "reordered"))
    assert repeated.status == status, repeated
    assert reordered.status == "pass", reordered


def test_shaking_a_scene_by_roundings_moves_its_motion_by_roundings():
    """One seed gives one scene. Its numbers differ from the original's by a few 1e-16, and its motion by less
    than 1e-12 of the length or rad (1.1e-13 is measured), and not by zero."""
    for name in ("spatial_slider_crank", "four_bar_gravity"):
        scene, times = SPECIMENS[name].scene, np.linspace(0, SPECIMENS[name].scene.duration, 5)
        first, again, other = (shaken(scene, seed) for seed in (0, 0, 1))
        assert first == again and first != other and first != scene, name
        exact, moved = (truth_for(s).poses(times) for s in (scene, first))
        apart = trial.difference(scene, exact, moved)
        assert 0 < apart < 1e-12, f"{name}: {apart:.1e}"


def test_an_engine_that_refuses_every_scene_is_not_shown_to_conform(capsys):
    """The exit status is 1 with one scene of the suite, and with one random mechanism."""
    assert main(["verify", f"{FAKES}:REFUSING", "--scene", "free_fall", "--in-process"]) == 1
    assert "an engine that runs no scene is not shown to conform" in " ".join(capsys.readouterr().out.split())
    assert main(["verify", f"{FAKES}:REFUSING", "--mechanisms", "1", "--in-process"]) == 1


def test_verify_refuses_an_unknown_scene_with_status_two(capsys):
    assert main(["verify", "mbref", "--scene", "nothing"]) == 2
    assert "unknown scene of the suite 'nothing'" in capsys.readouterr().err


def test_table_of_verdicts_has_a_line_for_each_scene():
    """Of the door two checks pass, one is outside its range, and "truth" is nearest to its limit, with 5e-7
    of 1e-6. Of the pendulum one check fails, whose name is given. Counts of zero are left blank."""
    verdicts = [
        suite.Verdict("truth", "door", "pass", 5e-7, 1e-6),
        suite.Verdict("closure", "door", "pass", 1e-9, 1e-6),
        suite.Verdict("energy", "door", "outside", reason="a driver moves it"),
        suite.Verdict("truth", "pendulum", "fail", 2e-3, 1e-6),
    ]
    console = Console(file=io.StringIO(), width=80)
    console.print(next(iter(suite.tables(suite.Conformance("mine", "1.0", verdicts)))))
    lines = [" ".join(line.split()) for line in console.file.getvalue().splitlines()]
    assert "door 2 1 truth at 50 % of its limit" in lines and "pendulum 1 truth" in lines, lines


def test_tables_of_verdicts_end_with_the_failures_and_a_summary():
    """The door fails a check, the spring is refused ("cannot"), the pendulum passes: two scenes ran."""
    verdicts = [
        suite.Verdict("run", "door", "fail", reason="it crashed"),
        suite.Verdict("refusal", "spring", "cannot", reason="no springs"),
        suite.Verdict("run", "pendulum", "pass"),
    ]
    *_, failure, summary = map(str, suite.tables(suite.Conformance("mine", "1.0", verdicts)))
    assert failure == "fail: door, run: it crashed"
    assert summary == "mine: 1 pass, 1 fail, 1 cannot, 0 outside; 2 of 3 scenes run"


def test_coordinate_partitioning_passes_the_check_in_millimetres():
    """The check compares the motion with the one of the scene in millimetres. Rounding of millimetres is
    1000 times as large, and Newton's method of the partitioning has to end above this rounding."""
    specimen, family = SPECIMENS["drawn loop"], "mpi-svd+partitioning"
    bench = trial.set_up(InProcess(engine("mbref")), specimen, family)
    verdict = suite.verdict_on("in millimetres", bench)
    assert verdict.status == suite.PASS, verdict
