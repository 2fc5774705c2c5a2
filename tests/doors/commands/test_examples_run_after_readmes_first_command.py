"""Examples and the notebook run with the packages of README's first command; their numbers are right."""

import os
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from crosscheck.judge.truth import truth_for
from mbref import rotations
from mbref.scene import Scene
from tests.helpers.measured import MARGIN

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "examples"
NOTEBOOK = """
import ast, json, sys
names = {}
for cell in json.load(open(sys.argv[1]))["cells"]:
    if cell["cell_type"] == "code":
        assert cell["outputs"] == [], "the notebook is committed without outputs"
        tree = ast.parse("".join(cell["source"]))
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, "notebook", "exec"), names)
        if last:
            shown = eval(compile(ast.Expression(last.value), "notebook", "eval"), names)
            print(getattr(shown, "_repr_html_", shown.__repr__)())
"""


def needed(name: str, extras: frozenset[str]) -> set[str]:
    """Return the names of the distributions that pip installs for one with its extras, itself included."""
    found: dict[str, frozenset[str]] = {}
    waiting = [(name, extras)]
    while waiting:
        one, asked = waiting.pop()
        if asked <= found.get(one, frozenset()) and one in found:
            continue
        found[one] = asked | found.get(one, frozenset())
        for text in metadata.requires(one) or ():
            part = Requirement(text)
            if part.marker is None or any(part.marker.evaluate({"extra": e}) for e in ("", *found[one])):
                waiting.append((canonicalize_name(part.name), frozenset(part.extras)))
    return set(found)


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the Python of a new environment with links to what README's first command installs."""
    readme = (ROOT / "README.md").read_text()
    extras = re.search(r"^python3 -m venv .*-e '\.\[([\w,-]+)\]' && .*crosscheck", readme, re.MULTILINE)
    assert extras, "README's first command installs the packages and writes a report"
    place = tmp_path_factory.mktemp("environment")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(place)], check=True)
    (packages,) = place.glob("lib/python*/site-packages")
    for name in needed("mbref", frozenset(extras[1].split(","))):
        distribution = metadata.distribution(name)
        tops = {file.parts[0] for file in distribution.files or ()} - {"..", "__pycache__"}
        for top in (top for top in tops if name != "mbref" or top.endswith(".dist-info")):
            source, target = Path(str(distribution.locate_file(top))), packages / top
            if source.exists() and not target.exists():
                target.symlink_to(source)
    (packages / "checkout.pth").write_text(f"{ROOT}\n")
    return place / "bin" / "python"


def output(python: Path, tmp_path: Path, *words: str | Path) -> str:
    """Return the output of Python in an empty directory, which stays empty."""
    command, outside = [python, *words], {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    limit = 600  # s; Pinocchio compiles C++ code
    given = {"cwd": tmp_path, "env": outside, "timeout": limit}
    run = subprocess.run(command, capture_output=True, text=True, check=False, **given)
    assert run.returncode == 0, f"{words[-1]}: status {run.returncode}: {run.stderr[-800:]}"
    assert not list(tmp_path.iterdir()), f"{words[-1]} left {list(tmp_path.iterdir())}"
    return run.stdout


def test_packages_of_readmes_first_command_have_engines_matplotlib_and_pandas_alone(python, tmp_path):
    """pip resolves the requirements in pyproject.toml so. The environment has neither pytest nor pip, so that
    the examples below run with what a user has installed."""
    found = "from importlib.util import find_spec as f; print(*(f(n) is not None for n in {}))"
    code = found.format(("mujoco", "pinocchio", "exudyn", "matplotlib", "pandas", "pytest", "pip"))
    assert output(python, tmp_path, "-c", code).split() == ["True"] * 5 + ["False"] * 2


def test_every_engine_of_the_first_example_completes_near_the_exact_motion(python, tmp_path):
    """The example prints each engine's error against the judge's truth. 1.5e-6 (rad, or relative to the
    scene's length) was the largest that was measured; MARGIN allows ten times as much on other processors."""
    printed = output(python, tmp_path, EXAMPLES / "01_run_and_compare.py")
    runs = re.findall(r"^(\w+) .* (\w+) +t = (\S+) s, error (\S+)$", printed, re.MULTILINE)
    assert {engine for engine, *_ in runs} >= {"mbref", "mujoco", "exudyn"}, printed
    assert {(outcome, float(end)) for _, outcome, end, _ in runs} == {("COMPLETED", 0.01)}, printed
    assert max(float(error) for *_, error in runs) < MARGIN * 1.5e-6, printed


def test_second_example_prints_the_judges_angles_of_a_closing_door(python, tmp_path):
    """The judge's reference has the door at the 21 times; angles are printed with one digit. Three hinges and
    a ball joint have 3 · 5 + 3 = 18 rows, for three bodies with 18 coordinates. The loop lies in a plane and
    moves in one way, so that 17 rows are independent and one is redundant."""
    printed = output(python, tmp_path, EXAMPLES / "02_own_mechanism.py")
    angles = [float(text) for text in re.findall(r"closed by +(\S+)°", printed)]
    scene = Scene.from_file(EXAMPLES / "door_closer.toml")
    poses = truth_for(scene).poses(np.linspace(0.0, scene.duration, 21))
    turns = poses.orientation[:, poses.bodies.index("door")]
    right = np.degrees(rotations.angle_between(turns, turns[:1]))
    assert "18 rows, 1 redundant, 1 free" in printed, printed
    assert angles == pytest.approx(right, abs=0.051)  # degrees: half of the last digit, and a margin


@pytest.mark.slow
def test_deviations_of_the_tolerance_example_agree_with_first_order_theory(python, tmp_path):
    """Standard deviations of 200 variants have a statistical error of 1 / √(2 · 200) = 5 %; 30 % is six times
    that. Linear propagation of the tolerances is the theory."""
    printed = output(python, tmp_path, EXAMPLES / "03_tolerances.py")
    rows = re.findall(r"deviation (\S+) m  \(first order: (\S+) m\)", printed)
    pairs = np.array(rows, dtype=float)[2:]  # too little has moved at the first two times
    assert len(pairs) == 4, printed
    assert np.all(abs(pairs[:, 0] / pairs[:, 1] - 1) < 0.3), printed


def test_every_cell_of_the_notebook_runs_and_shows_pictures_and_numbers(python, tmp_path):
    """A drawing, an animation, the lag of the crank in rad, and an array of positions."""
    printed = output(python, tmp_path, "-c", NOTEBOOK, EXAMPLES / "04_first_steps.ipynb")
    assert "<svg" in printed and "<animate" in printed
    assert re.search(r"the crank with the heavier slider is -?\d+\.\d{3} rad behind", printed)
    assert "'slider.position.x': array(" in printed


FALL = """
import sys
sys.path.append(sys.argv[1])
engine = __import__(sys.argv[2]).ENGINE
from mbref.scene import Body, Scene
ball = Body(name="ball", mass=2.0, inertia=(0.1, 0.1, 0.1), position=(0.0, 0.0, 0.0))
scene = Scene(name="fall", gravity=(0.0, -9.81, 0.0), duration=1.0, body=[ball])
run = engine.run(scene, [0.0, 1.0], engine.settings(scene)[-1])
print(run.outcome.name, run.position[-1, 0, 1])
"""


@pytest.mark.parametrize("name", ["tiny_engine", "spatial_engine"])
def test_example_engine_runs_a_free_fall_without_any_further_package(name, python, tmp_path):
    """The ball falls by g t² / 2 in a second; both integrate parabolas exactly, except for rounding."""
    outcome, height = output(python, tmp_path, "-c", FALL, EXAMPLES / name, name).split()
    assert outcome == "COMPLETED" and float(height) == pytest.approx(-9.81 / 2, rel=1e-9)
