"""Commands and Python that README and docs print run as a reader would run them."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from mbref.scenes import SCENES
from tests.printed_commands import FOUND, ROOT, commands

SHORT = ("compare", "run", "list", "certify", "reference", "tune", "report")  # commands of minutes at most
REPEATED = "docs/results/closed-loops.md"  # its commands repeat stored records, of other engines too
ROBOT = """<mujoco><worldbody><body name="trunk" pos="0 0 1"><freejoint/>
<inertial pos="0 0 0" mass="2" diaginertia="0.02 0.02 0.02"/>
<body name="crank"><joint name="A" axis="0 1 0"/>
<inertial pos="0 0 -0.1" mass="1" diaginertia="0.02 0.02 0.01"/>
<body name="coupler" pos="0 0 -0.2"><joint name="B" axis="0 1 0"/>
<inertial pos="0.15 0 0" mass="1" diaginertia="0.01 0.02 0.02"/></body></body>
<body name="rocker" pos="0.3 0 0"><joint name="D" axis="0 1 0"/>
<inertial pos="0 0 -0.1" mass="1" diaginertia="0.02 0.02 0.01"/></body></body></worldbody>
<equality><connect body1="coupler" body2="rocker" anchor="0.3 0 0"/></equality>
<keyframe><key name="home" qpos="0 0 1 1 0 0 0 0.3 -0.3 0.3" qvel="0 0 0 0 0 0 1 -1 1"/></keyframe>
</mujoco>"""

OF_CROSSCHECK = {
    " ".join(words): words
    for page, words in FOUND
    if words[:1] == ["crosscheck"] and words[1] in SHORT and "--render" not in words and page != REPEATED
}


def slow(page: str) -> Any:
    """Return a page whose commands run with `make deep` only."""
    return pytest.param(page, marks=pytest.mark.slow)


def run(words: list[str], folder: Path) -> None:
    """Run a command in a folder, as a reader would."""
    program, *arguments = words
    words = [sys.executable, "-m", program, *arguments]
    ran = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, f"{' '.join(words)}: {ran.stdout[-1000:]}{ran.stderr[-1000:]}"


PARTS = [f"docs/methods/{path.name}" for path in sorted((ROOT / "docs/methods").glob("*.md"))]


OWN = {  # my.toml of a page, else the template of `mbref new`
    "docs/equilibrium.md": "flyball_governor",
    "docs/outputs.md": "spatial_slider_crank_driven",
}
OTHERS = [f"docs/{name}.md" for name in ("methods", "records", "error-estimate", "results/which-engine")]
OTHERS += [*OWN, *PARTS]


@pytest.mark.parametrize("page", ["README.md", *map(slow, OTHERS)])
def test_printed_commands_of_mbref_end_with_status_0(page, tmp_path):
    """Commands of a page run in its order, in one folder. Its my.toml is the template of `mbref new`, or the
    scene that OWN names; README makes its own. test_transcripts.py compares outputs."""
    if page in OWN:
        SCENES[OWN[page]]().save(tmp_path / "my.toml")
    elif page != "README.md":
        run(["mbref", "new", "my.toml"], tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    for words in commands(ROOT / page, ("sh",)):
        if words[0] == "mbref":
            run(words, tmp_path)


@pytest.mark.parametrize("page", ["README.md", slow("docs/api.md"), slow("docs/judge.md")])
def test_printed_python_runs_without_error(page, tmp_path, monkeypatch):
    """Each block of the page runs alone, as a reader would paste it."""
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```$", (ROOT / page).read_text(), re.S | re.M)
    assert blocks
    for block in blocks:
        exec(block, {})


@pytest.mark.slow
@pytest.mark.parametrize("words", OF_CROSSCHECK.values(), ids=OF_CROSSCHECK)
def test_printed_command_of_crosscheck_ends_with_status_0(words, tmp_path):
    """Each runs in a folder of its own that has my.toml, robot.xml and the scene files that it names."""
    if words[1] == "certify":
        pytest.importorskip("flint")
    run(["mbref", "new", "my.toml"], tmp_path)
    (tmp_path / "robot.xml").write_text(ROBOT)
    for name in (word.removesuffix(".toml") for word in words if word.endswith(".toml")):
        if name in SCENES:
            SCENES[name]().save(tmp_path / f"{name}.toml")
    run(words, tmp_path)
