"""The wheel, installed into an empty environment in another folder, runs one of each command."""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path
from typing import NamedTuple

import pytest

from crosscheck.cli.parser import parser as crosscheck_parser
from mbref.cli.commands import parser as mbref_parser

ROOT = Path(__file__).parents[3]
SHORT = "--samples 3 --duration 0.01"
MODEL = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0"/>
<inertial pos="0 0 -1" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
COMMANDS = {  # --help of the commands that take long
    "mbref": [
        *("new my.toml", "assemble my.toml --out closed.toml", "schema", "draw my.toml"),
        *("animate my.toml --duration 0.1", f"run four_bar_gravity {SHORT} --out motion.csv"),
        *(f"plot four_bar_gravity energy {SHORT} --out energy.svg", "equilibrium point_pendulum --starts 1"),
        *("diagnose my.toml --start", "modes point_pendulum --starts 1", "fit --help", "design --help"),
        f"sensitivities four_bar_gravity {SHORT} --of energy --to gravity.y",
        *("ensemble four_bar_gravity --help", "import model.xml"),
        *("export four_bar_gravity --out four_bar.xml", "list", "completion bash"),
    ],
    "crosscheck": [
        # without compiled modules, its process imports for some seconds
        *("list engines", f"run four_bar_gravity --engine mbref --method alf {SHORT} --time-limit 60"),
        *(f"compare four_bar_gravity --engine exudyn {SHORT}", "tune --help", "verify --help", "findings"),
        *("files model.xml --engine mbref", "closed-loops", "convergence", "invariants", "alternatives"),
        *(f"reference four_bar_gravity {SHORT} --out reference.csv", "judge four_bar_gravity motion.csv"),
        *("report --render report --section speed", "paper --help", "diff report report", "certify --help"),
        *("modes", "diagnose four_bar_gravity --engine mujoco", "versions --help", "derivatives"),
    ],
}
RUNNER = """
import importlib, io, json, sys, contextlib, traceback
found = []
for program, *words in json.load(open("commands.json")):
    main, said = importlib.import_module(f"{program}.cli").main, io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            status = main(words)
    except SystemExit as end:
        status = end.code or 0
    except BaseException:
        status, said = "traceback", io.StringIO(traceback.format_exc())
    found.append([program, words, status, said.getvalue()[-2000:]])
files = [getattr(module, "__file__", None) or "" for module in list(sys.modules.values())]
json.dump([found, files], open("found.json", "w"))
"""
LARGE = ("*.png", "*.svg", "*.jsonl", "*.pyc", "index.html", "paper-runs.json")


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    """Return a folder with the wheel and the source archive of a copy of the project."""
    pytest.importorskip("setuptools", minversion="77", reason="older versions cannot build the project")
    source, made = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("made")
    for folder in ("mbref", "crosscheck"):
        shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in ("reports", "docs", "examples", "tests"):
        shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns(*LARGE))
    for path in ROOT.iterdir():
        if path.is_file():
            shutil.copy(path, source)
    build = "from setuptools import build_meta as b; b.build_sdist({0!r}); b.build_wheel({0!r})"
    command = [sys.executable, "-c", build.format(str(made))]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    return made


@pytest.mark.slow
def test_a_wheel_has_two_packages_and_every_file_of_data(built):
    """The checkout's files are the truth; modules and templates of reports stand in crosscheck/reports."""
    (wheel,) = built.glob("*.whl")
    files = zipfile.ZipFile(wheel).namelist()
    assert {name.partition("/")[0] for name in files if ".dist-info" not in name} == {"mbref", "crosscheck"}
    needed = {name for folder in ("mbref", "crosscheck") for name in of_folder(folder)}
    of_reports = [name for name in of_folder("reports") if name.endswith(".py") or "/templates/" in name]
    needed |= {f"crosscheck/{name}" for name in of_reports}
    assert of_reports and needed <= set(files), sorted(needed - set(files))


def of_folder(folder: str) -> list[str]:
    """Return the names of the files in a folder of the project, without compiled modules."""
    paths = [p for p in (ROOT / folder).rglob("*") if p.is_file() and "__pycache__" not in p.parts]
    return [path.relative_to(ROOT).as_posix() for path in paths]


@pytest.mark.slow
def test_a_source_archive_has_documents_and_no_tests(built):
    """setuptools adds a folder tests of itself, which MANIFEST.in leaves out."""
    (archive,) = built.glob("*.tar.gz")
    with tarfile.open(archive) as file:
        inside = {name.partition("/")[2] for name in file.getnames()}
    assert {"CHANGELOG.md", "README.md", "LICENSE", "docs/tutorial.md", "setup.py"} <= inside
    assert not [name for name in inside if name.startswith("tests")]


@pytest.mark.slow
@pytest.mark.parametrize(("program", "parser"), [("mbref", mbref_parser), ("crosscheck", crosscheck_parser)])
def test_commands_that_the_wheel_is_tried_with_are_all_commands_of_the_programs_help(program, parser):
    """COMMANDS has the command lines of this file; the help lists each command indented by four blanks."""
    known = re.findall(r"^    ([a-z][a-z-]+)(?: |$)", parser().format_help(), flags=re.M)
    assert {command.split()[0] for command in COMMANDS[program]} == set(known)


class Installed(NamedTuple):
    """Commands that ran one after another in a process of an environment with the wheel alone."""

    folder: Path  # the working folder
    ends: list  # of each command: [program, words, exit status or "traceback", standard error]
    modules: list[str]  # files of the modules that the process loaded


@pytest.fixture(scope="module")
def installed(built, tmp_path_factory) -> Installed:
    """Install the wheel into a new environment and run COMMANDS in an empty folder."""
    environment, folder = tmp_path_factory.mktemp("environment"), tmp_path_factory.mktemp("folder")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(environment)], check=True)
    (packages,) = environment.glob("lib/python*/site-packages")
    (wheel,) = built.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(packages)
    (packages / "libraries.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    no_pages = shutil.ignore_patterns("*.md", "*.png")
    shutil.copytree(ROOT / "reports" / "reference", folder / "report", ignore=no_pages)
    (folder / "model.xml").write_text(MODEL)
    (folder / "runner.py").write_text(RUNNER)
    commands = [(program, *words.split()) for program, rows in COMMANDS.items() for words in rows]
    (folder / "commands.json").write_text(json.dumps(commands))
    outside = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    variables = {**outside, "NUMBA_DISABLE_JIT": "1", "XDG_CACHE_HOME": str(environment / "cache")}
    python = [str(environment / "bin" / "python"), "-I", "runner.py"]
    done = subprocess.run(python, cwd=folder, env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return Installed(folder, *json.loads((folder / "found.json").read_text()))


@pytest.mark.slow
def test_each_command_of_an_installed_wheel_ends_with_status_0_and_renders_a_report(installed):
    """COMMANDS ran in an environment of the wheel alone; one is `crosscheck report --render`."""
    assert len(installed.ends) == sum(map(len, COMMANDS.values()))
    for program, words, status, said in installed.ends:
        assert status == 0 and "Traceback" not in said, (program, words, status, said)
    assert (installed.folder / "report" / "report.md").is_file()


@pytest.mark.slow
def test_commands_of_a_wheel_load_no_module_of_the_checkout(installed):
    """The process lists the files of its modules: mbref's are in site-packages, where the wheel is."""
    folders = tuple(str(ROOT / name) for name in ("mbref", "crosscheck", "reports"))
    assert [name for name in installed.modules if "/site-packages/mbref/" in name]
    assert not [name for name in installed.modules if name.startswith(folders)]
