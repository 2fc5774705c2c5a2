"""Commands of crosscheck: exit status, standard output and standard error, and reasons of refusals."""

import io
import json
import shlex
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from crosscheck.cli import certifying, tables
from crosscheck.cli.commands import main
from crosscheck.cli.parser import parser
from crosscheck.study import grid
from crosscheck.study.command import command
from crosscheck.study.search.cheapest import by_error
from crosscheck.study.search.execution import NOT_STARTED, CoarseFirst
from mbref.scene import Moment, Scene
from mbref.scenes import SCENES
from tests.helpers.fake_engines import FAKES
from tests.helpers.statics import rod

FAKE = f"{FAKES}:FAKE"
COMMANDS = ("list", "run", "compare", "tune", "verify", "report", "paper", "diff", "certify")
# fields of a record and of its cost (docs/records.md); the fake engine estimates no error
FIELDS = ["engine", "version", "method", "settings", "asked", "outcome", "message", "t_end", "times"]
FIELDS += ["bodies", "reactions", "metrics", "cost"]
COST = {"seconds", "build_seconds", "steps", "rejected", "rhs", "factorisations", "newton"}
CERTIFY = ("certify", "four_bar_gravity", "--digits", "4", "--duration", "0.002", "--out")


@pytest.fixture
def still(tmp_path: Path) -> str:
    return saved(tmp_path, "still")


def saved(folder: Path, name: str, **changes: object) -> str:
    """Save a scene of one block at rest, as the fake engine leaves it: its error is zero."""
    block = rod("block", (1.0, 2.0, 3.0), inertia=1.0)
    path = folder / f"{name}.toml"
    Scene(**{"name": name, "body": (block,), "duration": 0.5, **changes}).save(path)
    return str(path)


def run_main(capsys: pytest.CaptureFixture, *argv: str) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of a command line."""
    try:
        status = main(argv)
    except SystemExit as stop:  # argparse's own way out
        status = int(stop.code or 0)
    printed = capsys.readouterr()
    assert "Traceback" not in printed.err, printed.err
    return status, printed.out, printed.err


def test_json_of_a_run_has_the_fields_of_a_record_and_the_engines_states(capsys, still):
    """FAKE leaves the block at (1, 2, 3) m and says that its runs took 0.1 and 0.2 s."""
    asked = ("--engine", FAKE, "--setting", "plain", "--times", "0,0.1,0.3", "--json")
    status, out, _ = run_main(capsys, "run", still, *asked)
    document = json.loads(out)
    assert status == 0, (status, document)
    assert set(document) == {"scene", "records"} and document["scene"] == "still", document
    assert len(document["records"]) == 2, [r["settings"] for r in document["records"]]
    for record, seconds in zip(document["records"], (0.1, 0.2), strict=True):
        assert list(record) == FIELDS and set(record["cost"]) == COST, record
        assert (record["cost"]["seconds"], record["settings"]["seconds"]) == (seconds, seconds), record
        assert (record["engine"], record["version"], record["method"]) == ("fake", "1.2.3", "plain"), record
        assert record["times"] == [0.0, 0.1, 0.3] and record["t_end"] == 0.3, record["times"]
        assert record["bodies"]["block"]["position"] == [[1.0, 2.0, 3.0]] * 3, record["bodies"]
        assert record["bodies"]["block"]["orientation"] == [[1.0, 0.0, 0.0, 0.0]] * 3, record["bodies"]
        assert record["metrics"], "no metric"


@pytest.fixture
def two(tmp_path, monkeypatch) -> tuple[str, ...]:
    """Arguments of `run` with two bodies at rest, without a closed form, and an empty cache of references."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    blocks = [rod(name, (1.0, y, 3.0), inertia=1.0) for name, y in (("a", 0.0), ("b", 2.0))]
    path = saved(tmp_path, "two", body=blocks)
    return ("run", path, "--engine", FAKE, "--setting", "plain", "--samples", "3")


def test_a_scene_without_a_closed_form_is_judged_by_its_reference_if_it_has_time(capsys, two):
    """FAKE leaves two bodies at rest, where no force acts: its error is zero. The bound of the reference's
    error is the least one that the judge states, 1e-14. Without a reference the error is unknown."""
    sentence = "There is no reference for two: no reference was requested."
    for seconds, wanted in (("0", (None, None)), ("20", (0.0, 1e-14))):
        asked = (*two, "--reference-time", seconds)
        measured = [r["metrics"] for r in json.loads(run_main(capsys, *asked, "--json")[1])["records"]]
        assert [(m["error"], m["error_bound"]) for m in measured] == [wanted] * 2, measured
        assert (sentence in run_main(capsys, *asked)[1]) == (seconds == "0")


def test_json_of_two_scenes_is_a_list_in_their_order(capsys, tmp_path):
    """Scenes "b" and "a", in this order. FAKE has three settings of its families plain and noisy."""
    paths = [saved(tmp_path, "b"), saved(tmp_path, "a")]
    status, out, _ = run_main(capsys, "run", *paths, "--engine", FAKE, "--samples", "3", "--json")
    documents = json.loads(out)
    assert status == 0
    assert [d["scene"] for d in documents] == ["b", "a"], [d["scene"] for d in documents]
    assert [[r["method"] for r in d["records"]] for d in documents] == [["plain", "plain", "noisy"]] * 2


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--times=-1,0.2"], "--times: must be finite and not negative, got -1"),
        (["--times", "0"], "--times: must have a time after 0"),
        (["--times", "0,1", "--duration", "0.5"], "--times: must end by --duration 0.5, got 1"),
        (["--option", "seconds=1", "--setting", "plain", "--setting", "noisy"], "needs one --engine and one"),
        (["--option", "seconds"], "must be name=value, got 'seconds'"),
        (["--times", "0,x"], "must be numbers separated by commas, got '0,x'"),
        (["--setting", "gentle"], "unknown method or setting 'gentle'; known: 'plain', 'noisy'"),
        (["--setting", "noisi"], "did you mean 'noisy'?"),
        (["--engine", "mujco"], "did you mean 'mujoco'?"),
        (["--engine", FAKE, "--setting", "plain", "--option", "secs=1"], "plain has no option 'secs'"),
        (["--setting", "plain", *("--option", "seconds=1") * 2], "--option: seconds is given twice; give it"),
        (["--engine", "ode"], "unknown engine 'ode'; known: mbref, mujoco, pinocchio, exudyn"),
        (["--engine", "no_such_module:ENGINE"], "engine 'no_such_module:ENGINE' cannot be loaded"),
    ],
)
def test_a_faulty_option_is_refused_with_status_two_and_its_reason(capsys, still, options, sentence):
    """The command is ``crosscheck run``; standard error has the reason, and standard output stays empty."""
    status, out, err = run_main(capsys, "run", still, "--engine", FAKE, "--json", *options)
    assert status == 2, (status, err)
    assert out == "", out
    assert sentence in err, (sentence, err)


def test_every_fault_of_a_scene_file_is_reported_with_its_line(capsys, tmp_path):
    """Gravity is in line 2, the body's table begins in line 3, and its mass is in line 5."""
    path = tmp_path / "bad.toml"
    body = '[[body]]\nname = "a"\nmass = -1.0\nposition = [0, 0, 0]\n'
    path.write_text(f'name = "bad"\ngravity = [0, 0]\n{body}')
    status, out, err = run_main(capsys, "run", str(path), "--json")
    assert (status, out) == (2, ""), (status, out)
    assert err.splitlines() == [
        "gravity: must be three numbers, got [0, 0] (line 2)",
        "body[a].mass: must not be negative, got -1.0 (line 5)",
        "body[a].inertia: is missing; give mass and inertia, or neither (kinematics) (line 3)",
    ]


def test_a_velocity_that_contradicts_a_joint_is_reported_once_with_the_joints_line(capsys, tmp_path):
    """The body moves along x at 5 m/s, away from its hinge; the joint's table begins in line 8."""
    path = tmp_path / "bad.toml"
    path.write_text(
        'name = "bad"\n[[body]]\nname = "a"\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\n'
        "position = [1.0, 0.0, 0.0]\nvelocity = [5.0, 0.0, 0.0]\n"
        '[[joint]]\nname = "A"\ntype = "revolute"\nbodies = ["ground", "a"]\n'
        "anchor = [0.0, 0.0, 0.0]\naxis = [0.0, 0.0, 1.0]\n"
    )
    status, _, err = run_main(capsys, "compare", str(path))
    assert status == 2 and err.count("contradict") == 1 and err.strip().endswith("(line 8)"), err


@pytest.mark.parametrize(
    ("others", "ended", "run"),
    [([], 2, ""), (["free"], 0, "free")],
    ids=["no scene is left", "another scene is run"],
)
def test_a_scene_that_an_engine_cannot_run_is_left_out_with_the_reason(capsys, tmp_path, others, ended, run):
    """The engine FAKE refuses loads. If no scene is left, standard output has no JSON."""
    loaded = saved(tmp_path, "loaded", load=(Moment(body="block", moment=(1.0, 0.0, 0.0)),))
    scenes = [loaded, *(saved(tmp_path, name) for name in others)]
    status, out, err = run_main(capsys, "run", *scenes, "--engine", FAKE, "--json")
    assert "fake cannot run loaded: this fake has no loads" in err and FAKE not in err, err
    assert (status, json.loads(out)["scene"] if out else "") == (ended, run), (status, out)


def test_an_engine_without_its_package_is_left_out_with_the_command_that_installs_it(capsys, still):
    """The exit status is 2 if no engine is left, 0 if another one runs."""
    missing = f"{FAKES}:MISSING"
    sentence = f"{missing}: the package fake-package is not installed: pip install fake-package"
    status, out, err = run_main(capsys, "run", still, "--engine", missing)
    assert (status, out, err.strip()) == (2, "", sentence), err
    status, _, err = run_main(capsys, "run", still, "--engine", missing, "--engine", FAKE)
    assert status == 0 and sentence in err, (status, err)


@pytest.mark.parametrize("what", ["scenes", "engines", "methods", "settings", "metrics"])
def test_list_names_every_scene_engine_method_setting_and_metric(capsys, what):
    """Methods are formulations, stabilisations and integrators, and settings are the engines' families."""
    from crosscheck.engine import engine, engine_names
    from crosscheck.judge.metrics import METRICS
    from mbref.formulations import FORMULATIONS
    from mbref.integrators import INTEGRATORS
    from mbref.stabilisation import STABILISATIONS

    known = {
        "scenes": SCENES,
        "engines": engine_names(),
        "methods": (*FORMULATIONS, *STABILISATIONS, *INTEGRATORS),
        "metrics": METRICS,
        "settings": [family for name in engine_names() for family in engine(name).families],
    }[what]
    status, out, _ = run_main(capsys, "list", what)
    listed = "".join(out.split())  # columns may break a name
    assert status == 0 and [name for name in known if "".join(name.split()) not in listed] == [], out


@pytest.mark.parametrize("name", COMMANDS)
def test_help_ends_with_an_example_that_the_parser_accepts(capsys, name):
    """The last line of ``crosscheck COMMAND --help`` is a command line of this command."""
    status, out, _ = run_main(capsys, name, "--help")
    example = out.rstrip().splitlines()[-1].strip()
    assert status == 0 and "example:\n" in out and example.startswith(f"crosscheck {name}"), out
    parser().parse_args(example.split()[1:])


def test_error_of_an_adapter_that_cannot_be_imported_names_its_file_and_line(capsys, tmp_path, monkeypatch):
    """The class `Engine` is abstract, so that its instance in line 3 is a TypeError."""
    (tmp_path / "bad_adapter.py").write_text("from crosscheck.engine import Engine\n\nENGINE = Engine()\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    status, _, err = run_main(capsys, "verify", "bad_adapter:ENGINE")
    assert status == 2 and err.startswith("engine 'bad_adapter:ENGINE' cannot be loaded: TypeError: "), err
    assert err.endswith(f"({tmp_path / 'bad_adapter.py'}, line 3)\n"), err


def test_certify_without_python_flint_says_how_to_install_it(capsys, monkeypatch):
    """Python finds no package, as if python-flint were not installed; the exit status is 2."""
    monkeypatch.setattr(certifying.importlib.util, "find_spec", lambda name: None)
    status, _, err = run_main(capsys, "certify", "heavy_top")
    assert status == 2 and err.endswith("not installed: pip install python-flint\n"), err


def test_certify_refuses_an_output_file_in_a_missing_folder(capsys, tmp_path):
    """The command would compute first and write last; it ends at once with status 2 and the folder's name."""
    pytest.importorskip("flint", reason="python-flint is the extra `certify`")
    status, _, err = run_main(capsys, *CERTIFY, str(tmp_path / "nowhere" / "table.json"))
    assert status == 2 and err.endswith(f"argument --out: there is no folder {tmp_path / 'nowhere'}\n"), err


def test_certify_writes_its_table_and_prints_the_progress_of_both_formulations(capsys, tmp_path):
    """CERTIFY asks for a table of 4 digits of the motion up to 0.002 s. Progress is printed in hundredths of
    the motion; the last line of each formulation has 100 of 100."""
    pytest.importorskip("flint", reason="python-flint is the extra `certify`")
    status, _, err = run_main(capsys, *CERTIFY, str(tmp_path / "table.json"))
    assert status == 0 and json.loads((tmp_path / "table.json").read_text())["digits"] == 4, err
    for name in "AB":
        assert f"formulation {name}: 100 of 100" in err and "t = 0.002 s" in err, err


def test_printed_command_of_a_record_repeats_its_run(capsys, still):
    """Two records have other samples, options and outcomes; 1/3 needs all digits of a double."""
    scene = Scene.from_file(still).with_(duration=0.3)
    other = np.array([0.1, 0.25]), {"seconds": 0.5, "outcome": "NOT_FINITE"}
    asked = [(np.linspace(0, 0.3, 4), {"seconds": 1 / 3}), other]
    cases = [grid.Case(scene, times, FAKE, grid.Setting("a b", options)) for times, options in asked]
    records = grid.study(cases)
    assert [record["outcome"] for record in records] == ["COMPLETED", "NOT_FINITE"]
    for record in records:
        program, *words = shlex.split(command(record, still))
        _, out, err = run_main(capsys, *words, "--json")
        [again] = json.loads(out)["records"]
        assert program == "crosscheck", program
        for name in ("times", "settings", "metrics", "outcome", "method"):
            assert again[name] == record[name], (name, again[name], record[name], err)


def test_an_engine_whose_settings_raise_is_left_out_with_its_error(capsys, still):
    """The method ``settings`` of NO_SETTINGS raises a ValueError; FAKE's three settings are run."""
    asked = ("--engine", FAKE, "--engine", f"{FAKES}:NO_SETTINGS", "--json")
    status, out, err = run_main(capsys, "run", still, *asked)
    assert status == 0 and "its settings are unknown: ValueError: no table of steps" in err, err
    assert [r["asked"]["engine"] for r in json.loads(out)["records"]] == [FAKE] * 3


def test_settings_finer_than_one_that_timed_out_are_not_started(tmp_path):
    """Runs sleep for 0, 30 and 40 s, with a limit of 0.5 s. RECORDER writes a line for each run it begins."""
    scene = Scene(name=str(tmp_path / "log"), body=Scene.from_file(saved(tmp_path, "s")).body)
    settings = [grid.Setting("a", {"sleep": s}) for s in (0.0, 30.0, 40.0)]
    times = np.array([0.0, 1.0])
    slow = [grid.Case(scene, times, f"{FAKES}:RECORDER", setting, 0.5) for setting in settings]
    records = grid.study(slow, ThreadPoolExecutor(1), run=CoarseFirst())
    assert [r["outcome"] for r in records] == ["COMPLETED", "TIMED_OUT", "TIMED_OUT"], records
    assert records[2]["message"] == NOT_STARTED and len((tmp_path / "log").read_text().splitlines()) == 2


def test_json_of_tune_has_the_cheapest_setting_of_every_family_and_its_command(capsys, still):
    """FAKE says that it takes 0.1 and 0.2 s in its family `plain` and 0.5 s in `noisy`; its error is zero."""
    status, out, err = run_main(capsys, "tune", FAKE, still, "--error", "1e-6", "--json")
    document = json.loads(out)
    assert status == 0, err
    assert [r["settings"] for r in document["records"]] == [{"seconds": 0.1}, {"seconds": 0.5}], document
    assert "--option seconds=0.1 " in document["records"][0]["command"], document["records"][0]["command"]


def test_tune_has_exit_status_one_if_no_setting_reaches_the_error(capsys, still):
    """ELSEWHERE puts every body 1 mm off, more than 1e-4 of the length; an error of 1e-6 is the default."""
    status, out, err = run_main(capsys, "tune", f"{FAKES}:ELSEWHERE", still)
    assert status == 1 and "No setting reaches an error of 1e-06" in out, (out, err)
    document = json.loads(run_main(capsys, "tune", f"{FAKES}:ELSEWHERE", still, "--json")[1])
    assert document["reason"] in " ".join(out.split()) and document["nearest"]["metrics"]["error"] > 1e-4


NOT_REACHED = {  # error of the only run, bound of its truth's error, outcome: the sentence that tune prints
    (1e-7, 1e-12, "COMPLETED"): "No setting reaches an error of 1e-08; the nearest",
    (1e-9, 1e-7, "COMPLETED"): "The truth is known to 1e-07, so no run can be seen",
    (None, None, "COMPLETED"): "No error is known, because no truth of this motion is known",
    (1e-9, 1e-12, "NOT_FINITE"): "no run completes",
}


@pytest.mark.parametrize(("error", "bound", "outcome"), NOT_REACHED)
def test_tune_says_why_no_run_reaches_the_error(error, bound, outcome):
    """The error asked for is 1e-8; there is one run, and ``bound`` is the error of the truth. Of the four
    sentences of NOT_REACHED, only the one for this run is printed."""
    run = {"engine": "e", "family": "f", "outcome": outcome, "t_end": 1.0, "cost": {"seconds": 1}}
    run |= {"asked": {"options": {"s": 1.0}}, "metrics": {"error": error, "error_bound": bound}}
    shown = Console(width=200, file=io.StringIO())
    tables.print_tuning(shown, by_error(1e-8), [], [run], SCENES["four_bar"](), "my.toml")
    printed = shown.file.getvalue()
    said = [sentence for sentence in NOT_REACHED.values() if sentence in printed]
    assert said == [NOT_REACHED[error, bound, outcome]], printed


def test_version_lists_crosscheck_and_installed_engines(capsys):
    """MuJoCo, which these tests require to be installed, has a line of its own."""
    status, out, _ = run_main(capsys, "--version")
    assert status == 0 and out.startswith("crosscheck ") and "\nmujoco " in out, out


def test_compare_gives_the_least_and_the_median_of_five_timings_of_each_run(capsys, still):
    """VARYING says that successive runs take 2, 0.4, 1, 4 and 0.7 times the seconds of their setting. Three
    settings are run by turns, so that each has all five factors: the least is 0.4 and the median 1."""
    asked = ("--engine", f"{FAKES}:VARYING", "--depth", "whole", "--json")
    status, out, err = run_main(capsys, "compare", still, *asked)
    assert status == 0, err
    for record, seconds in zip(json.loads(out)["records"], (0.1, 0.2, 0.5), strict=True):
        assert record["cost"]["seconds"] == pytest.approx(0.4 * seconds), record
        assert record["timing"] == {"median": seconds, "repeats": 5}, record


def test_compare_prints_a_verdict_ratios_of_times_and_the_command_of_the_cheapest_run(capsys, still):
    """FAKE says that settings take 0.1, 0.2 and 0.5 s: ratios 1, 2 and 5. The verdict has three answers."""
    status, out, _ = run_main(capsys, "compare", still, "--engine", FAKE)
    verdict = ("Who is right: fake agrees with the truth", "How fast: fake reaches", "Where each breaks: ")
    table = ("time (s)    ratio", "1.00e-01      1.0", "2.00e-01      2.0", "5.00e-01      5.0", "fake plain")
    cheapest = f"crosscheck run {still} --engine {FAKE} --setting plain --option seconds=0.1"
    assert status == 0
    for words in (*verdict, *table, "known in closed form", cheapest):
        assert words in out, (words, out)


# the engine ELSEWHERE puts every body 1 mm off the scene, at the start already
WITH_ELSEWHERE = ("--engine", FAKE, "--engine", f"{FAKES}:ELSEWHERE")


def test_compare_gives_no_verdict_on_an_engine_whose_bodies_start_elsewhere(capsys, still):
    """ELSEWHERE is left out with the reason, and FAKE, which is right, is judged; the exit status is 1."""
    status, out, err = run_main(capsys, "compare", still, *WITH_ELSEWHERE)
    assert status == 1, err
    assert "still: elsewhere: the adapter or the scene differs: initial position: truth and elsewhere" in err
    assert "fake is right at its best settings" in out, out
    assert "elsewhere is not judged, because the adapter or the scene" in " ".join(out.split()), out


def test_compare_tries_every_family_before_it_says_that_an_engine_completes_no_run(capsys, still):
    """The fourth of four families alone completes its run. With only the first one no run completes."""
    status, out, _ = run_main(capsys, "compare", still, "--engine", f"{FAKES}:LAST_ONE_RUNS")
    assert status == 0 and "last is right at its best settings" in out and "fourth" in out, out
    asked = ("--engine", f"{FAKES}:LAST_ONE_RUNS", "--setting", "first")
    status, out, _ = run_main(capsys, "compare", still, *asked)
    assert "last completes no run" in " ".join(out.split()) and "fourth" not in out, out


@pytest.mark.parametrize("command", ["alternatives", "closed-loops", "convergence", "invariants", "modes"])
@pytest.mark.parametrize("name", ["mujoco", "no such engine"])
def test_an_engine_without_run_is_refused_where_stored_runs_of_all_engines_are_shown(capsys, command, name):
    """The tables have every engine: the option would be ignored, also with an unknown name."""
    status, out, err = run_main(capsys, command, "--engine", name)
    assert status == 2 and not out and ("--run" in err or f"unknown engine {name!r}" in err), err
