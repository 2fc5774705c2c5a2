"""The suite as pytest tests, of a sound engine and a faulty one: what is run, kept and reported."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from crosscheck.conformance.findings import shrunk, violates
from crosscheck.conformance.mechanisms.moving import moving_probes
from crosscheck.conformance.runners import InProcess
from tests.zoo.defects import DEFECTS, SOURCE, engine

ROOT = Path(__file__).parents[3]


def held(
    place: Path, chosen: str, *options: str, name: str = "spatial_engine:ENGINE", path: str | None = None
) -> subprocess.CompletedProcess[str]:
    """Run pytest with the plug-in in the folder ``place`` on the suite's tests ``chosen`` by -k, for the
    engine ``name``. With ``path`` as PYTHONPATH the engine runs in child processes."""
    plugin = ["-p", "crosscheck.conformance.pytest_plugin", "-p", "cacheprovider", "-o", "addopts="]
    named = ["--pyargs", "crosscheck.conformance", "--engine", name, "-k", chosen]
    named += [] if path else ["--in-process"]
    command = [sys.executable, "-m", "pytest", "-q", *plugin, "--rootdir", place, *named, *options]
    found = {"PYTHONPATH": path or f"{place}{os.pathsep}{ROOT}", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    env, limit = {**os.environ, **found}, 300  # s
    given = {"cwd": place, "env": env, "timeout": limit}
    return subprocess.run(command, capture_output=True, text=True, check=False, **given)


def test_resume_repeats_no_test_that_passed_before(tmp_path):
    """A sound engine passes the probe of free fall; then its file loses gravity. With --resume the stored
    pass counts and no test fails; without it the suite fails (exit status 1)."""
    (tmp_path / "spatial_engine.py").write_text(SOURCE.read_text())
    first = held(tmp_path, "free_fall")
    assert first.returncode == 0 and " passed" in first.stdout, first.stdout[-1500:] + first.stderr[-500:]
    faulty = SOURCE.read_text().replace("np.array(self.scene.gravity)", "np.zeros(3)")
    (tmp_path / "spatial_engine.py").write_text(faulty)
    assert held(tmp_path, "free_fall", "--resume").returncode == 0
    assert held(tmp_path, "free_fall").returncode == 1


@pytest.mark.parametrize(
    ("name", "says"),
    [("no_such_module:ENGINE", "No module named 'no_such_module'"), ("nothing", "unknown engine 'nothing'")],
)
def test_unknown_engine_is_a_usage_error_before_any_test(tmp_path, name, says):
    """The message has the option, its value and the reason."""
    run = held(tmp_path, "free_fall", name=name)
    assert run.returncode == pytest.ExitCode.USAGE_ERROR, run.stdout[-1500:]
    assert f"--engine {name}: " in run.stderr and says in run.stderr, run.stderr


@pytest.mark.slow
def test_violation_of_a_real_defect_is_shrunk_to_a_smaller_scene():
    """The engine damps springs with the wrong sign; the smaller scene has fewer joints and still fails."""
    scene = moving_probes()["spring load"]
    faulty = violates(InProcess(engine(DEFECTS["spring's damping with the wrong sign"])), "truth")
    small = shrunk(scene, faulty, tries=12)
    assert faulty(small) and len(small.joint) < len(scene.joint), small


def test_check_fails_for_a_defect_and_passes_for_the_sound_engine():
    """The check compares with the truth; the defective engine ignores the damping of springs."""
    scene = moving_probes()["spring load"].with_(gravity=(0.0, 0.0, 0.0))
    assert violates(InProcess(engine(DEFECTS["spring's damping ignored"])), "truth")(scene)
    assert not violates(InProcess(engine()), "truth")(scene)
