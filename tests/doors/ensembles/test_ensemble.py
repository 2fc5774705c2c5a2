"""Streamed, resumed and spread runs of ensembles equal single runs; variants differ as requested."""

import ctypes
import json
import math
import signal
import time
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from mbref.cli import main
from mbref.ensembles.ensemble import ensemble
from mbref.ensembles.processes import processes
from mbref.records import RecordsError
from mbref.scene import Scene, SceneError
from mbref.scene.variation import Variation, variants
from mbref.scenes import SCENES
from mbref.scenes.spatial_slider_crank import OFFSET, RADIUS, ROD
from mbref.simulation.simulate import Limits, simulate

TIMES = np.array([0.0, 0.004, 0.01])
LIMITS = Limits(rtol=1e-8)
METHOD = "alf-dual+projection"
DRIVEN = SCENES["spatial_slider_crank_driven"]()
VARY = [Variation("joint[B].anchor[0]", 0.1, 1e-3, normal=True), Variation("body[slider].mass", 0.9, 1.1)]


def samples(runs) -> dict[int, list]:
    """Return positions and velocities of runs, by the place of their scene."""
    return {place: [run.position.tolist(), run.velocity.tolist()] for place, run in runs}


def test_runs_spread_over_two_processes_equal_single_runs():
    """Samples of five variants are equal to the bit."""
    scenes = list(variants(DRIVEN, VARY, 5))
    alone = {k: simulate(scene, METHOD, TIMES, LIMITS) for k, scene in enumerate(scenes)}
    with processes(2) as pool:
        spread = samples(ensemble(iter(scenes), TIMES, METHOD, LIMITS, pool))
    assert spread == samples(alone.items())
    masses = [scene.body[2].mass for scene in scenes]
    assert len(set(masses)) == 5, f"the variants are to differ: {masses}"


def test_variants_of_a_slider_crank_move_as_the_closed_form_of_their_lengths():
    """The slider's place by y_C = sqrt(l² - (r cos θ - d)² - (r sin θ)²) with each variant's r and l, to 100
    rtol (m). Place B of six variants, and with it both lengths, differs from the built-in one."""
    scenes, rtol = list(variants(DRIVEN, VARY[:1], 6)), 1e-11
    with ThreadPoolExecutor(1) as one:
        runs = dict(ensemble(scenes, TIMES, METHOD, Limits(rtol=rtol), one))
    start = DRIVEN.joint[2].anchor
    for k, scene in enumerate(scenes):
        pin = np.array(scene.joint[1].anchor)
        r, l = np.linalg.norm(pin), np.linalg.norm(np.array(start) - pin)
        assert r != RADIUS and math.isclose(r, RADIUS, rel_tol=0.1) and math.isclose(l, ROD, rel_tol=0.1)
        theta = DRIVEN.driver[0].polynomial[1] * TIMES
        exact = np.sqrt(l**2 - (r * np.cos(theta) - OFFSET) ** 2 - (r * np.sin(theta)) ** 2)
        off = np.abs(runs[k].position[:, 2, 1] - exact).max()
        assert off < 100 * rtol, f"variant {k} with r = {r}: off by {off:.2e} m"


def test_stored_run_is_read_from_the_file_only_for_equal_limits_and_times(tmp_path: Path):
    """Each computed run adds a line to the file; a run that is read from the file adds none. The finer of two
    tolerances needs more evaluations of the equations."""
    path = tmp_path / "runs.jsonl"
    with ThreadPoolExecutor(1) as one:
        [(_, rough)] = ensemble([DRIVEN], TIMES, METHOD, Limits(rtol=1e-4), one, path)
        [(_, fine)] = ensemble([DRIVEN], TIMES, METHOD, Limits(rtol=1e-10), one, path)
        [(_, short)] = ensemble([DRIVEN], TIMES[:2], METHOD, Limits(rtol=1e-4), one, path)
        [(_, again)] = ensemble([DRIVEN], TIMES, METHOD, Limits(rtol=1e-4), one, path)
    assert fine.cost.rhs > rough.cost.rhs, (fine.cost, rough.cost)
    assert len(short.times) == 2 and again.position.tolist() == rough.position.tolist()
    assert len(path.read_text().splitlines()) == 3


def test_stored_bodies_are_read_by_name_and_a_completed_run_without_its_last_sample_is_refused(tmp_path):
    """Tools such as ``jq -S`` sort the names in a file: coupler, crank, rocker; the scene begins with the
    crank. A record whose samples were cut has another last state, and would enter the mean."""
    path, scene = tmp_path / "runs.jsonl", SCENES["four_bar"]()
    with ThreadPoolExecutor(1) as one:
        [(_, run)] = ensemble([scene], TIMES, METHOD, LIMITS, one, path)
        record = json.loads(path.read_text())
        path.write_text(json.dumps(record, sort_keys=True) + "\n")
        [(_, again)] = ensemble(["four_bar"], TIMES, METHOD, LIMITS, one, path)
        assert again.bodies == run.bodies and again.position.tolist() == run.position.tolist()
        for values in (record, *record["bodies"].values(), record["reactions"], record["angles"]):
            values |= {key: rows[:2] for key, rows in values.items() if isinstance(rows, list)}
        path.write_text(json.dumps(record | {"open_reactions": None}) + "\n")
        with pytest.raises(RecordsError, match="is no result of a run; remove this line"):
            list(ensemble([scene], TIMES, METHOD, LIMITS, one, path))


def test_another_process_reports_all_faults_of_a_scene():
    """Three bodies without mass and no driver: three faults, as in this process."""
    light = tuple(body.model_copy(update={"mass": None, "inertia": None}) for body in DRIVEN.body)
    undriven = DRIVEN.with_(body=light, driver=())
    with processes(1) as pool, pytest.raises(SceneError) as raised:
        list(ensemble([undriven], TIMES, METHOD, LIMITS, pool))
    with pytest.raises(SceneError) as here:
        simulate(undriven, METHOD, TIMES, LIMITS)
    assert raised.value.faults == here.value.faults
    assert len(raised.value.faults) == 3, raised.value.faults


def test_random_numbers_of_variants_have_the_requested_distributions():
    """400 scenes are drawn: the mean of place B is 0.1 m within 4 standard errors, 4 σ / √400, its deviation
    σ = 1 mm within 15 %. Masses are uniform in 0.9 to 1.1 kg, and come within 0.01 kg of both ends. The
    correlation is below 0.2."""
    scenes = list(variants(DRIVEN, VARY, 400, seed=3))
    x = np.array([scene.joint[1].anchor[0] for scene in scenes])
    mass = np.array([scene.body[2].mass for scene in scenes])
    assert abs(x.mean() - 0.1) < 4 * 1e-3 / 20 and abs(x.std() / 1e-3 - 1) < 0.15, (x.mean(), x.std())
    assert 0.9 <= mass.min() < 0.91 and 1.09 < mass.max() <= 1.1, (mass.min(), mass.max())
    assert abs(np.corrcoef(x, mass)[0, 1]) < 0.2


def test_variant_depends_on_its_seed_and_number_alone_and_differs_in_nothing_else():
    """The first ten of twenty variants equal ten variants of a request for ten. Each variant has two new
    numbers, which VARY names; with the old numbers put back it equals the original."""
    scenes = list(variants(DRIVEN, VARY, 20, seed=3))
    old = DRIVEN.joint_named("B").anchor[0], DRIVEN.body[2].mass
    for s in scenes:
        assert s.joint_named("B").anchor[0] != old[0] and s.body[2].mass != old[1]
        assert s.with_(VARY[0].path, old[0]).with_(VARY[1].path, old[1]) == DRIVEN
    assert list(variants(DRIVEN, VARY, 10, seed=3)) == scenes[:10]
    assert next(variants(DRIVEN, VARY, 1, seed=4)) != scenes[0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("body[0].mass", "is not PATH=LOW:HIGH"),
        ("body[0].mass=1", "is not PATH=LOW:HIGH"),
        ("body[0].mass=2:1", "must have LOW"),
        ("body[0].mass=1+--1", "must have LOW"),
        ("body[0].mass=0:inf", "must have LOW"),
        ("bodies[0].mass=1:2", "bodies[0].mass: is not a path"),
        ("body[nobody].mass=1:2", "body[nobody].mass: the scene has no 'nobody'"),
        ("body[0].name=1:2", "body[0].name: the scene has no number at this path"),
        ("duration=1:2", "--vary: duration changes no sample time"),
        ("body[0].mass=1:2 --vary body[crank].mass=3:4", "varies the same number as body[0].mass"),
        ("body[0].mass=-2:-1", "variant 0: body[crank].mass: must not be negative"),
    ],
)
def test_command_refuses_a_number_that_cannot_vary(text: str, says: str, capsys: pytest.CaptureFixture):
    """Faults of the syntax, the interval, the path and the number; nothing is printed on standard output."""
    status = main(["ensemble", "four_bar", "--vary", *text.split(), "--workers", "1"])
    printed = capsys.readouterr()
    assert (status, printed.out) == (2, "")
    assert says in printed.err, printed.err


def test_command_prints_mean_and_deviation_of_single_runs(tmp_path: Path, capsys: pytest.CaptureFixture):
    """The truth is NumPy's mean and deviation of four single runs, to rounding; --out has a line for each."""
    path = tmp_path / "runs.jsonl"
    words = "ensemble spatial_slider_crank_driven --vary joint[B].anchor[0]=0.1+-1e-3 --count 4 --times 0.01"
    command = [*words.split(), "--rtol", "1e-8", "--workers", "1", "--out", str(path)]
    status = main([*command, "--json"])
    printed = json.loads(capsys.readouterr().out)
    assert (status, printed["completed"]) == (0, 4)
    runs = [simulate(s, METHOD, [0.01], LIMITS) for s in variants(DRIVEN, VARY[:1], 4)]
    places = np.array([run.position[-1, 2] for run in runs])
    rounding = 1e-13  # m, of a sum of four
    assert np.allclose(printed["mean_position"]["slider"], places.mean(axis=0), rtol=0, atol=rounding)
    assert np.allclose(printed["deviation_position"]["slider"], places.std(axis=0), rtol=0, atol=rounding)
    assert len(path.read_text().splitlines()) == 4


def test_killed_process_loses_only_the_call_that_killed_it():
    """The third of eight calls kills its process; the others return the powers of 2 that they compute."""
    with processes(2) as pool:
        before = [pool.submit(pow, 2, k) for k in range(2)]
        killed = pool.submit(signal.raise_signal, signal.SIGKILL)
        behind = [pool.submit(pow, 2, k) for k in range(2, 7)]
        assert type(killed.exception()).__name__ == "BrokenProcessPool"
        assert [call.result() for call in (*before, *behind)] == [2**k for k in range(7)]


def sleeping(begun: Path, holds_interpreter: bool) -> None:
    """Sleep for a day, perhaps without any other thread of this process running."""
    begun.touch()
    (ctypes.PyDLL if holds_interpreter else ctypes.CDLL)(None).sleep(86400)


@pytest.mark.slow
@pytest.mark.parametrize("holds_interpreter", [False, True])
def test_interrupt_ends_calls_of_processes_that_still_run(holds_interpreter: bool, tmp_path: Path):
    """The call would sleep for a day; without the interrupt's effect on it, this test does not end."""
    with pytest.raises(KeyboardInterrupt), processes(1) as pool:
        call = pool.submit(sleeping, tmp_path / "begun", holds_interpreter)
        while not (tmp_path / "begun").exists():
            time.sleep(0.01)
        raise KeyboardInterrupt
    assert isinstance(call.exception(), BrokenExecutor)


class Fragile(Executor):
    """An executor whose process dies in each call for which ``kills(scenes)`` is true."""

    def __init__(self, kills: Callable[[Sequence[Scene]], bool]):
        self.kills = kills

    def submit(self, function, /, scenes, *arguments):
        future: Future = Future()
        if self.kills(scenes):
            future.set_exception(BrokenExecutor())
        else:
            future.set_result(function(scenes, *arguments))
        return future


def test_killed_run_is_reported_as_crashed_and_not_stored(tmp_path: Path):
    """The process dies in each call that has the second of three scenes."""
    scenes, path = list(variants(DRIVEN, VARY, 3)), tmp_path / "runs.jsonl"
    runs = dict(ensemble(scenes, TIMES, METHOD, LIMITS, Fragile(lambda given: scenes[1] in given), path))
    assert [runs[k].outcome.name for k in range(3)] == ["COMPLETED", "CRASHED", "COMPLETED"]
    assert runs[1].message == "its process was killed" and runs[1].bodies == runs[0].bodies
    assert len(path.read_text().splitlines()) == 2


def test_runs_before_a_faulty_scene_are_returned():
    """Scene 25 of 30 has neither masses nor a driver: the runs of 0 to 24 are returned before the error. Its
    note names the scene."""
    scenes = list(variants(DRIVEN, VARY, 30))
    scenes[25] = scenes[25].with_(
        driver=(), body=tuple(body.model_copy(update={"mass": None, "inertia": None}) for body in DRIVEN.body)
    )
    found: list[int] = []
    with ThreadPoolExecutor(1) as one, pytest.raises(SceneError) as raised:
        found.extend(k for k, _ in ensemble(scenes, TIMES, METHOD, Limits(rtol=1e-3), one))
    assert set(range(25)) <= set(found) and 25 not in found, found
    assert any("scene 25 " in note for note in raised.value.__notes__)
