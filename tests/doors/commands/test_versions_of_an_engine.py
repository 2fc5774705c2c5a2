"""Two versions of an engine's package: changes beyond noise, the release that made them, and refusals."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crosscheck.alternatives.at_model import disagreements
from crosscheck.cli.commands import main
from crosscheck.engine import Setting
from crosscheck.versions.bisection import bisected
from crosscheck.versions.differences import Found, between
from crosscheck.versions.environment import NotInstalled, Requirement
from crosscheck.versions.library import defaults_of, used_names
from crosscheck.versions.measured import Measured
from tests.helpers.falling_engine import STONE, Falling

PACKAGE, ENGINE = "falling-engine", "falling_engine:ENGINE"
SOURCE = (Path(__file__).parents[2] / "helpers" / "falling_engine.py").read_text()


def write_wheel(folder, version, factor=1.0, step=0.1, fall="fall"):
    """Write the wheel of a version with these constants and this name of its function."""
    named, info = f"falling_engine-{version}", f"falling_engine-{version}.dist-info"
    text = SOURCE.replace("FACTOR, STEP = 1.0, 0.1", f"FACTOR, STEP = {factor}, {step}")
    files = {
        "falling_engine.py": text.replace("def fall(", f"def {fall}("),
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {PACKAGE}\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    files[f"{info}/RECORD"] = "".join(f"{name},,\n" for name in [*files, f"{info}/RECORD"])
    with zipfile.ZipFile(folder / f"{named}-py3-none-any.whl", "w") as wheel:
        for name, content in files.items():
            wheel.writestr(name, content)


SEVERAL = "tests.helpers.falling_engine:SEVERAL"  # its solvers fall with g or 1.5 g


def versions(folder: Path, *words: str) -> tuple[int, Any, str]:
    """Return exit status, JSON and messages of the command, which knows the wheels of the folder alone."""
    own = {"PIP_CONFIG_FILE": os.devnull, "PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(folder)}
    command = [sys.executable, "-m", "crosscheck", "versions", *words, "--engine", ENGINE, "--json"]
    places = os.environ | own | {"XDG_CACHE_HOME": str(folder / "cache")}
    done = subprocess.run(command, env=places, capture_output=True, text=True, check=False)
    return done.returncode, json.loads(done.stdout or "null"), done.stderr


def measured(
    version: str, factor: float = 1.0, seconds: float = 1.0, card: str = "pass", engine: str | None = None
) -> Measured:
    """Return what a version does on the stone, and one verdict of the suite; its solvers are an engine's."""
    setting = Setting("plain", {"step": 1e-3})
    run = Falling().run(STONE, np.linspace(0.0, 0.2, 3), Setting("plain", {"factor": factor})).to_record()
    run |= {"asked": {"options": setting.options}, "metrics": {}, "cost": {"seconds": seconds}}
    verdict = {"scene": "pendulum", "card": "energy/1", "status": card, "measured": 0.1, "reason": ""}
    suite = {"verdicts": [verdict | {"allowed": 1.0}]}
    pairs = [one._asdict() for one in disagreements(STONE, [engine] if engine else [])]
    documents = [{"scene": "stone", "records": [run], "disagreements": pairs}, suite]
    return Measured(Requirement(PACKAGE, version), {}, documents, {})


@pytest.mark.parametrize(
    ("changed", "kinds"),
    [
        ({}, []),
        ({"factor": 1.0 + 1e-9, "seconds": 1.5}, []),  # noise
        ({"factor": 1.5}, [("accelerations", "at the start by 0.33 of the largest; error 0 → 0.5")]),
        ({"seconds": 3.0}, [("cost", "time 1.00e+00 s → 3.00e+00 s")]),
        ({"card": "fail"}, [("check", "pass → fail (0.1 → 0.1)")]),
    ],
    ids=["nothing", "noise", "gravity", "time", "check"],
)
def test_changes_beyond_noise_are_named_by_kind(changed: dict[str, Any], kinds: list[tuple[str, str]]):
    """Noise is a relative change of 1e-9 of the gravity, or half as much time again. Gravity 1.5 times too
    large changes accelerations by (1.5 - 1) / 1.5 = 0.33 of the largest, and their error from 0 to 0.5."""
    found = between(measured("1.0"), measured("1.1", **changed), [STONE])
    assert [(one.kind, one.change) for one in found] == kinds


def test_solvers_that_agree_in_one_version_alone_are_named_with_the_right_one():
    """In one of two versions a solver takes 1.5 g, by which it is off by a third of its acceleration."""
    agree, differ = measured("1.0"), measured("1.1", engine=SEVERAL)
    (appeared,), (gone,) = between(agree, differ, [STONE]), between(differ, agree, [STONE])
    assert appeared.kind == gone.kind == "solvers" and appeared.is_result
    assert appeared.change.startswith("agree → differ: ") and "supports 'light'" in appeared.change
    assert gone.change.startswith("differ → agree: ") and between(differ, differ, [STONE]) == []


def test_commands_without_a_result_are_named_for_each_version_and_for_both():
    """`compare` ran out of memory with both versions, `verify` with 1.0 alone: no result is compared."""
    said = {"compare": "`compare` ends without a result: no memory"}
    old = measured("1.0")._replace(documents=[None, None], faults=said | {"verify": "`verify` ends"})
    new = measured("1.1")
    new = new._replace(documents=[None, new.documents[1]], faults=said)
    found = [(one.kind, one.change) for one in between(old, new, [STONE])]
    both = ("not compared", f"both: {said['compare']}")
    assert found == [("run", f"only {PACKAGE}==1.0: `verify` ends"), both]


def test_bisection_finds_the_change_past_versions_that_cannot_be_installed():
    """Versions are 1.0 to 1.19, and 1.13 changes gravity. Both ends are measured, and five versions between
    them, since 2⁴ < 19 steps < 2⁵. One more may be needed where 1.9 or 1.10, which cannot be installed, would
    be next. From 1.0 to 1.4 nothing changes."""
    known = [f"1.{k}" for k in range(20)]

    def measure(version: str) -> Measured:
        if version in ("1.9", "1.10"):
            raise NotInstalled(version)
        return measured(version, factor=2.0 if known.index(version) >= 13 else 1.0)

    def changes(old: Measured, new: Measured) -> list[Found]:
        return between(old, new, [STONE])

    found = bisected(known, measure, changes)
    assert (found.old, found.new) == ("1.12", "1.13") and set(found.skipped) <= {"1.9", "1.10"}
    assert found.made <= 2 + 5 + 1 and bisected(known[:5], measure, changes).new is None


@pytest.fixture(scope="module")
def four_versions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a scene of a falling stone and wheels of four versions of an engine.

    1.1 has another default step, 1.2 gravity 1.5 times too large, and 1.3 another name of a function.
    """
    folder = tmp_path_factory.mktemp("versions")
    STONE.save(folder / "stone.toml")
    write_wheel(folder, "1.0")
    write_wheel(folder, "1.1", step=0.2)
    write_wheel(folder, "1.2", factor=1.5, step=0.2)
    write_wheel(folder, "1.3", factor=1.5, step=0.2, fall="drop")
    return folder


@pytest.mark.slow
def test_versions_lists_a_changed_acceleration_default_and_name_of_a_function(four_versions: Path):
    """From 1.0 to 1.3 the stone's acceleration, and so its motion, becomes wrong by 0.5 of gravity."""
    stone = str(four_versions / "stone.toml")
    status, found, said = versions(four_versions, f"{PACKAGE}==1.0", f"{PACKAGE}==1.3", stone)
    assert status == 1, said
    kinds = {change["kind"]: change for change in found["changes"] if change["kind"] != "cost"}
    assert set(kinds) == {"accelerations", "error", "default", "API"}
    assert kinds["accelerations"]["change"].endswith("error 0 → 0.5")
    assert kinds["API"]["place"] == "falling_engine.fall"
    assert kinds["default"]["change"] == "0.1 → 0.2"
    for python in (four_versions / "cache").rglob("bin/python"):
        python.unlink()  # the environments have lost their interpreter, as after an upgrade of Python
    assert versions(four_versions, f"{PACKAGE}==1.0", f"{PACKAGE}==1.3", stone)[0] == 1


@pytest.mark.slow
def test_bisection_by_the_command_names_the_release_with_the_wrong_gravity(four_versions: Path):
    """Gravity changed from 1.1 to 1.2. The other default step of 1.1 changes no motion, as the engine's only
    setting gives the step."""
    stone = str(four_versions / "stone.toml")
    status, found, said = versions(four_versions, PACKAGE, stone, "--bisect", "1.0..1.3")
    assert status == 1 and (found["old"], found["new"]) == ("1.1", "1.2"), said


@pytest.mark.slow
def test_version_that_does_not_exist_is_refused_with_the_known_versions(four_versions: Path):
    """The folder, the only source of packages, has wheels of 1.0 to 1.3."""
    stone = str(four_versions / "stone.toml")
    status, _, said = versions(four_versions, f"{PACKAGE}==1.0", f"{PACKAGE}==1.4", stone)
    assert status == 2 and "there is no such version; known: 1.0, 1.1, 1.2, 1.3" in said


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["mujoco"], "must be PACKAGE==VERSION, such as mujoco==4.0.0, got 'mujoco'"),
        (["mujoco==3.0.0"], "two versions are needed, such as mujoco==3.0.0 mujoco==VERSION"),
        (["numpy==2.0", "numpy==2.1"], "numpy: not the package of one engine; add --engine E"),
        (["mujoco==3.0.0", "pin==3.0"], "mujoco and pin: not the package of one engine"),
        (["mujoco", "--bisect", "4.0.0"], "--bisect: must be OLD..NEW, such as 3.13.0..4.0.0, got '4.0.0'"),
        (
            ["mujoco==3.0.0", "--bisect", "3.0..4.0"],
            "--bisect: takes a package without a version, such as mujoco",
        ),
        (["a==1", "a==2", "--engine", "mujco"], "did you mean 'mujoco'?"),
    ],
)
def test_faulty_request_for_versions_is_refused_with_its_right_form(words, says, capsys):
    """One version, a package of two engines or of none, and misspelt options and engines."""
    assert main(["versions", *words]) == 2
    assert says in capsys.readouterr().err


def test_names_that_an_adapter_uses_of_a_library_are_found_under_their_full_names():
    """`t` is an alias of one.two. Names of json and of `self`, and `.c` of a result, are left out."""
    source = "import one.two as t\nfrom three import four\nimport json\nt.a.b(json.x)\nfour().c\nself.t.d\n"
    assert set(used_names(source)) == {"one.two", "three.four", "one.two.a", "one.two.a.b"}


def test_defaults_of_functions_and_objects_are_read_and_a_missing_name_is_reported():
    """Python's documentation states skipkeys=False of json.dumps, and 28 digits of a decimal context."""
    assert dict(defaults_of("json.dumps"))["json.dumps(skipkeys)"] is False
    assert dict(defaults_of("decimal.Context().prec")) == {"decimal.Context().prec": 28}
    assert dict(defaults_of("json.nothing")) == {"json.nothing": "missing"}
