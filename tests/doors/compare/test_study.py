"""Studies store each run once, also after a rerun, an interruption, a kill, or by another executor."""

import json
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.study.grid import Case, key, run_case, run_here, study
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Scene
from mbref.scenes import SCENES
from tests import kills
from tests.helpers.fake_engines import FAKE, FAKES

TIMES = np.array([0.0, 0.1, 0.3])


def still(name: str = "still", **changes: object) -> Scene:
    block = Body(name="block", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 3.0))
    return Scene(name=name, body=(block,), **changes)


def case(family: str, fake: str = "FAKE", scene: Scene | None = None, limit: float = 60.0) -> Case:
    return Case(scene or still(), TIMES, f"{FAKES}:{fake}", Setting(family, {"seconds": 0.5}), limit)


def test_record_of_a_study_holds_the_engine_s_trajectory():
    """Read back from JSON the record is the trajectory of a run here; case and machine are recorded, too."""
    wanted = case("a")
    [record] = study([wanted], ThreadPoolExecutor(1))
    there = Trajectory.from_record("still", json.loads(json.dumps(record)))
    here = FAKE.run(wanted.scene, TIMES, wanted.setting)
    assert there.to_record() == here.to_record(), (there, here)
    identity = {name: record[name] for name in ("schema", "key", "scene", "family", "seed")}
    assert identity == {"schema": 1, "key": key(wanted), "scene": "still", "family": "a", "seed": 0}
    assert record["versions"]["numpy"] == np.__version__, record["versions"]
    assert record["machine"]["cores"] >= 1, record["machine"]
    assert record["metrics"], "no metric was computed"


def test_study_stores_one_record_for_each_different_case(tmp_path: Path):
    """Case "a" is asked twice; an engine that crashes has a record too; progress counts three cases."""
    path, seen = tmp_path / "records.jsonl", []
    cases = [case("a"), case("b"), case("c", "SEGFAULT"), case("a")]
    records = study(cases, None, path, lambda done, total, record: seen.append((done, total)))
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [r["family"] for r in records] == ["a", "b", "c", "a"]
    assert [r["outcome"] for r in records] == ["COMPLETED", "COMPLETED", "CRASHED", "COMPLETED"]
    assert sorted(r["family"] for r in lines) == ["a", "b", "c"]
    assert all(r in records for r in lines), (lines, records)
    assert seen == [(1, 3), (2, 3), (3, 3)], seen


def test_second_study_runs_only_cases_that_are_not_stored(tmp_path: Path):
    """Cases a and b are stored, then a line that is cut short; the engine logs each run."""
    path, log = tmp_path / "records.jsonl", tmp_path / "log"
    cases = [case(family, "RECORDER", still(str(log))) for family in "abc"]
    study(cases[:2], None, path)
    with path.open("a") as file:
        file.write('{"schema": 1, "key": "cut sho')
    records = study(cases, None, path)
    assert sorted(line.split()[0] for line in log.read_text().splitlines()) == ["a", "b", "c"]
    stored = [json.loads(line) for line in path.read_text().splitlines()]
    assert sorted(stored, key=lambda r: r["family"]) == records


def test_interrupted_study_stores_the_runs_that_have_ended(tmp_path: Path):
    """After the first run the study's callback raises KeyboardInterrupt, while another run hangs."""
    path = tmp_path / "records.jsonl"

    def interrupt(done: int, total: int, record: dict) -> None:
        raise KeyboardInterrupt

    hanging = case("b", "HANG", still(str(tmp_path / "pid")), limit=60.0)
    with pytest.raises(KeyboardInterrupt):
        study([case("a"), hanging], ThreadPoolExecutor(2), path, interrupt)
    assert [json.loads(line)["family"] for line in path.read_text().splitlines()] == ["a"]


def test_case_that_timed_out_is_repeated_only_with_a_longer_limit(tmp_path: Path):
    """An engine that hangs: limits of 1, 0.5 and 1.5 s, in this order."""
    path, scene = tmp_path / "records.jsonl", still(str(tmp_path / "pid"))
    short, shorter, longer = (case("a", "HANG", scene, limit) for limit in (1.0, 0.5, 1.5))
    [first] = study([short], None, path)
    assert first["outcome"] == "TIMED_OUT", first["message"]
    assert study([shorter], None, path) == [first]
    [again] = study([longer], None, path)
    assert (again["key"], again["time_limit"]) == (first["key"], 1.5)


@pytest.fixture(scope="module")
def one_after_the_other() -> list[dict]:
    """Records of everywhere() in this process, one at a time."""
    with ThreadPoolExecutor(1) as one:
        return study(everywhere(), one)


def everywhere() -> list[Case]:
    """A real run, one that completes and one that fails."""
    scene = SCENES["planar_slider_crank"]()
    real = Case(scene, np.array([0.0, 0.05]), "mbref", Setting("alf-dual+projection", {"rtol": 1e-6}))
    return [real, case("a"), case("b", "RAISE")]


def test_run_in_a_child_gives_the_record_of_a_run_here():
    """Records are equal except for times and mbref's error estimate, which only a child makes."""
    wanted = Case(SCENES["four_bar"](), TIMES, "mbref", Setting("mpi-svd+projection", {"rtol": 1e-6}))
    here, child = untimed([run_here(wanted)]), untimed([run_case(wanted)])
    assert here[0].pop("error_estimate") is None and child[0].pop("error_estimate")["largest"] > 0
    assert here == child


@pytest.mark.slow
def test_cluster_or_pool_of_two_workers_gives_the_records_of_a_serial_study(one_after_the_other, tmp_path):
    """Returned and stored records equal records of one thread, except for times; the last run crashes."""
    from distributed import Client, LocalCluster

    path = tmp_path / "records.jsonl"
    quiet = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
    cluster = LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", scheduler_kwargs=quiet)
    with cluster, Client(cluster) as client:
        assert len(client.scheduler_info()["workers"]) == 2
        records = study(everywhere(), client.get_executor(), path)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        for found in (records, study(everywhere(), pool)):
            assert untimed(found) == untimed(one_after_the_other)
            assert [r["outcome"] for r in found] == ["COMPLETED", "COMPLETED", "CRASHED"]
    stored = [json.loads(line) for line in path.read_text().splitlines()]
    assert sorted(stored, key=lambda r: r["key"]) == sorted(records, key=lambda r: r["key"])


def untimed(records: list[dict]) -> list[dict]:
    """The records without the seconds that runs took, when they did, and the state of the checkout then."""
    kept = ("steps", "rejected", "rhs", "factorisations", "newton")
    return [{**r, "date": "", "commit": "", "cost": {n: r["cost"][n] for n in kept}} for r in records]


@pytest.mark.parametrize(
    "other",
    [
        case("b"),
        case("a", "RECORDER"),
        case("a", scene=still(gravity=(0.0, 0.0, -9.81))),
        case("a")._replace(times=TIMES[:2]),
        case("a")._replace(times=np.add(TIMES, (0.0, 0.0, 0.1))),
        case("a")._replace(setting=Setting("a", {"seconds": 0.6})),
        case("a", "THREADS"),
    ],
    ids=["family", "engine", "scene", "fewer times", "times", "options", "engine with threads"],
)
def test_key_depends_on_all_of_a_case_except_its_limits_of_time(other: Case, monkeypatch):
    """A case that differs from "a" in the part of its id has another key. Limits are of run and reference."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert key(other) != key(case("a"))
    assert key(other) == key(other._replace(time_limit=1.0, reference_time=2.0))


WHOLE = (200, 20)  # runs, kills
FEW = {"parents": (30, 2), "children": (6, 1), "workers": (6, 1)}
MOST_REPEATED = 3  # runs not yet stored when a process is killed: two under way, one being written


@pytest.mark.parametrize(
    ("kind", "runs", "times"),
    [*((k, *few) for k, few in FEW.items()), *(pytest.param(k, *WHOLE, marks=pytest.mark.slow) for k in FEW)],
)
def test_killed_processes_lose_no_record_and_repeat_no_stored_run(kind, runs, times, tmp_path):
    """A study's parent, an engine's child process or an ensemble's worker gets SIGKILL up to ``times`` times
    at random moments, at least half as often on a busy machine; each record is then there once. A kill makes
    at most one record CRASHED, and at most three runs that were not yet stored (MOST_REPEATED) are repeated.
    """
    found = kills.KINDS[kind](runs, times, tmp_path)
    assert times / 2 <= found.kills <= times, f"{kind}: {found}"
    assert found.found == found.wanted and not found.twice, f"{kind}: {found}"
    assert found.crashed <= times, f"{kind}: {found}"
    assert found.made <= runs + MOST_REPEATED * times, f"{kind}: {found}: stored runs were repeated"
