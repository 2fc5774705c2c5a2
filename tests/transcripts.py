"""Commands and Python that README and docs show with their outputs. Commands stand in blocks named
``console``. Python with an output is followed by OUTPUT and a block of text. ``python -m tests.transcripts
PAGE …`` runs both and writes their outputs into the pages."""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from mbref.command_line import Parser

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.S | re.M)
OUTPUT = "<!-- output -->"
PYTHON = re.compile(rf"^```python\n(.*?)^```\n\n{OUTPUT}\n```text\n(.*?)^```$", re.S | re.M)
WIDTH = 100  # columns of the terminal in which commands run
PROMPT = "$ "


def blocks(text: str) -> list[str]:
    """Return the console blocks of a page and the outputs of its Python, in order, without their fences."""
    return [*BLOCK.findall(text), *(output for _, output in PYTHON.findall(text))]


def commands(block: str) -> list[str]:
    """Return the commands of a block: its lines that begin with the prompt, without it."""
    return [line.removeprefix(PROMPT) for line in block.splitlines() if line.startswith(PROMPT)]


def filled(text: str) -> str:
    """Return a page with the present output under each command; its commands run in one new folder. Raises
    RuntimeError if a command printed nothing."""
    with tempfile.TemporaryDirectory() as folder:
        text = BLOCK.sub(lambda block: f"```console\n{_transcript(block[1], Path(folder))}```", text)
        return PYTHON.sub(lambda found: _shown(found[1], Path(folder)), text)


def shape(text: str) -> str:
    """Return the words of a text without what differs between machines: numbers, bounds, borders, breaks."""
    plain = re.sub(r"(< )?[-−]?\d+(\.\d+)?(e[-+]?\d+)?", "#", text)
    return " ".join(re.sub(r"[━─═┏┓┡┩┳╇├┤┼└┘┴╞╪╡]+", " ", plain).split())


def _transcript(block: str, folder: Path) -> str:
    return "".join(f"{PROMPT}{command}\n{_output(command, folder)}\n" for command in commands(block))


def _shown(code: str, folder: Path) -> str:
    """Return the blocks of Python and of its output."""
    (folder / "code.py").write_text(code)
    return f"```python\n{code}```\n\n{OUTPUT}\n```text\n{_output('python code.py', folder)}\n```"


def _output(command: str, folder: Path) -> str:
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    ran = subprocess.run(
        command,
        shell=True,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PATH": path, "COLUMNS": str(WIDTH), "PYTHONPATH": str(ROOT)},
    )
    shown = ran.stdout or (ran.stderr if ran.returncode else "")
    if not shown.strip():
        raise RuntimeError(f"{command} printed nothing, with exit status {ran.returncode}: {ran.stderr}")
    return "\n".join(line.rstrip() for line in shown.strip("\n").splitlines())


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("pages", nargs="+", type=Path, metavar="PAGE")
    for page in parser.parse_args().pages:
        page.write_text(filled(page.read_text()))
