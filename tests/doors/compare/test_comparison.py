"""`crosscheck.compare` gives what the command prints; runs of one engine follow each other."""

import json
import threading
import time

import numpy as np
import pytest

import crosscheck
from crosscheck.cli import main
from crosscheck.cli.comparison import Comparison
from crosscheck.cli.request import RequestError
from crosscheck.engine import Setting, engine
from crosscheck.study.grid import Case, key, study
from crosscheck.study.search.execution import Chains
from crosscheck.study.search.offers import default_cases
from crosscheck.study.search.selection import of_few_families
from mbref.scene import Body, Scene
from mbref.scenes import SCENES
from tests.helpers.fake_engines import FAKES

FAKE = f"{FAKES}:FAKE"
BODY = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
BLOCK = Scene(name="block", body=(BODY,), duration=0.5)


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Comparison:
    return crosscheck.compare(BLOCK, [FAKE], samples=3, out=tmp_path_factory.mktemp("records"))


def test_a_comparison_in_python_equals_the_json_of_the_command(compared, tmp_path, capsys):
    """Fields, headline, and settings and metrics of all runs are equal; times differ from run to run."""
    BLOCK.save(tmp_path / "block.toml")
    asked = ("compare", str(tmp_path / "block.toml"), "--engine", FAKE, "--samples", "3", "--json")
    assert main(asked) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["records"]
    compared.save(tmp_path / "saved.json")
    saved = json.loads((tmp_path / "saved.json").read_text())
    assert saved.keys() == printed.keys() and saved["verdict"]["headline"] == printed["verdict"]["headline"]
    for ours, theirs in zip(saved["records"], printed["records"], strict=True):
        assert (ours["settings"], ours["metrics"]) == (theirs["settings"], theirs["metrics"])


def test_text_of_a_comparison_has_its_headline_in_eighty_columns(compared):
    """Commands, which are copied into a shell, are not wrapped."""
    assert str(compared).startswith("\nblock, 0.5 s: bodies: 1")
    assert compared.verdict.headline in " ".join(str(compared).split())
    assert all(len(line) <= 80 for line in str(compared).splitlines() if "crosscheck run" not in line)


def test_rows_and_data_frame_of_a_comparison_have_one_row_a_run(compared):
    """FAKE has three settings, and the block, at rest without forces, has no error."""
    rows, frame = compared.rows, compared.to_dataframe()
    assert [row["verdict"] for row in rows] == ["right"] * 3 and frame.shape[0] == 3
    settings = sorted((row["family"], row["settings"]["seconds"]) for row in rows)
    assert settings == [("noisy", 0.5), ("plain", 0.1), ("plain", 0.2)]
    assert [row["error"] for row in rows] == [0.0] * 3 and list(frame["error"]) == [0.0] * 3


def test_a_comparison_refuses_an_unknown_depth_or_engine():
    """The errors state the depths quick and whole, and the engine's name."""
    with pytest.raises(RequestError, match="depth: must be quick or whole, got 'deep'"):
        crosscheck.compare(BLOCK, [FAKE], depth="deep")
    with pytest.raises(RequestError, match="unknown engine 'none'"):
        crosscheck.compare(BLOCK, ["none"])


def test_runs_of_one_engine_follow_each_other_and_do_not_wait_for_their_measurement():
    """Two engines have three runs each, of 20 ms, so that overlapping runs of an engine would be seen. Each
    measurement waits until all six runs have ended: it would wait for ever if a run waited for one."""
    times, each = np.array([0.0, 1.0]), [(k, name) for k in range(3) for name in ("first", "second")]
    cases = [Case(BLOCK, times, name, Setting("f", {"k": k})) for k, name in each]
    going, order, all_run = set(), [], threading.Event()

    def run(asked):
        assert asked.engine not in going, "two runs of one engine at a time"
        going.add(asked.engine)
        order.append((asked.engine, asked.setting.options["k"]))
        time.sleep(0.02)
        if len(order) == len(cases):
            all_run.set()
        going.discard(asked.engine)
        return asked

    def measure(asked, got):
        assert all_run.wait(60) and got is asked
        return {"key": key(asked)}

    with Chains(measure) as threads:
        found = study(cases, threads, run=run)
    assert [r["key"] for r in found] == [key(c) for c in cases]
    for name in ("first", "second"):
        assert [k for ran, k in order if ran == name] == [0, 1, 2]


def test_an_exception_in_a_run_is_raised_by_the_study():
    """The study has one case, which the executor of comparisons (``Chains``) runs."""

    def run(asked):
        raise OSError("no disk")

    with Chains(lambda asked, got: {}) as threads, pytest.raises(OSError, match="no disk"):
        study([Case(BLOCK, np.array([0.0, 1.0]), "e", Setting("f", {}))], threads, run=run)


def test_compare_takes_one_engine_and_one_family_without_a_list():
    """All rows are of engine "fake" and its family "plain", not of "noisy"."""
    found = crosscheck.compare(BLOCK, FAKE, families="plain", samples=3)
    assert {(row["engine"], row["family"]) for row in found.rows} == {("fake", "plain")}


def test_a_comparison_is_saved_as_json_only(compared, tmp_path):
    """The error names the file a.mp4 and the suffix .json."""
    with pytest.raises(ValueError, match=r"a.mp4: a comparison is saved as .json"):
        compared.save(tmp_path / "a.mp4")


def test_a_quick_comparison_runs_mbref_at_its_default_method():
    """mbref's default for small mechanisms is the method taylor. It is among the few families of a quick
    comparison, and the first of the engine's best settings."""
    scene = SCENES["four_bar_gravity"]()
    families = {case.setting.family for case in of_few_families(default_cases(scene, ["mbref"])[0])}
    assert "taylor" in families and engine("mbref").best_settings(scene)[0].family == "taylor"


def test_two_engines_of_one_name_are_refused():
    """Records have an engine's name alone: runs of one engine would be judged as the other's."""
    with pytest.raises(RequestError, match="both have the name 'fake'"):
        crosscheck.compare(BLOCK, [f"{FAKES}:FAKE", f"{FAKES}:KEEPING"])


def test_rows_of_an_engine_with_another_mechanism_are_unjudged():
    """The engine's bodies start 1 mm aside: its runs are unjudged in Python, too, as in the printed table."""
    found = crosscheck.compare(BLOCK, [FAKE, f"{FAKES}:ELSEWHERE"], families="plain", samples=3)
    rows = [row["verdict"] for row in found.rows if row["engine"] == "elsewhere"]
    assert set(rows) == {"unjudged"} and "elsewhere" in found.judged.differences
