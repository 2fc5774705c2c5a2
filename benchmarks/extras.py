"""Size and time of the extras: ``python benchmarks/extras.py [EXTRA …]`` installs each in a new environment.

It prints a row of a table for each extra: the size of the downloaded wheels, the CPU time of ``pip install``
from these wheels, the size of the environment, and the CPU time of the first import of the engines' packages.
An environment without extras comes first. Everything is removed at the end.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

from crosscheck.engine import engine_names

ROOT = Path(__file__).parents[1]
EXTRAS = {
    "": (),
    "engines": ("mujoco", "pinocchio", "exudyn"),
    "more-engines": ("simbody", "sundials", "ondsel"),
    "generators": ("casadi", "heyoka"),
    "drake": ("drake",),
    "dart": ("dart",),
    "bullet": ("bullet",),
    "mjx": ("mjx", "warp"),
    "newton": ("newton",),
}
IMPORT = "import sys; from crosscheck.engine import engine; [engine(n).prepare(()) for n in sys.argv[1:]]"


def main() -> None:
    """Install the extras one after the other, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("extra", nargs="*", default=list(EXTRAS), metavar="EXTRA")
    assert {name for names in EXTRAS.values() for name in names} <= set(engine_names())
    print(
        "| extra | engines | wheels (MB) | installation (CPU s) | environment (MB) | first import (CPU s) |"
    )
    print("| --- | --- | --: | --: | --: | --: |")
    asked = parser.parse_args().extra
    if unknown := [extra for extra in asked if extra not in EXTRAS]:
        parser.error(f"no extra {unknown[0]!r}; there are: {', '.join(filter(None, EXTRAS))}")
    for extra in asked:
        row = measured(extra)
        print(f"| {extra or 'none'} | {', '.join(EXTRAS[extra])} | " + " | ".join(row) + " |", flush=True)


def measured(extra: str) -> tuple[str, str, str, str]:
    """The cells of an extra: MB of wheels, CPU s of the installation, MB, CPU s of the first import."""
    with tempfile.TemporaryDirectory() as folder:
        wheels, place = Path(folder) / "wheels", Path(folder) / "environment"
        venv.create(place, with_pip=True)
        python = place / ("Scripts" if sys.platform == "win32" else "bin") / "python"
        of_extra = f"[{extra}]" if extra else ""
        timed([python, "-m", "pip", "wheel", "-q", "-w", wheels, f"{ROOT}{of_extra}"])
        offline = ["--no-index", "--find-links", wheels, f"mbref{of_extra}"]
        seconds = timed([python, "-m", "pip", "install", "-q", *offline])
        loading = timed([python, "-c", IMPORT, *EXTRAS[extra]])
        return f"{size(wheels):.0f}", f"{seconds:.0f}", f"{size(place):.0f}", f"{loading:.1f}"


def size(folder: Path) -> float:
    """Size of all files of a folder, MB."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6


def timed(command: list[object]) -> float:
    """CPU time (s) of a command, which must succeed."""
    before = os.times()
    subprocess.run([str(part) for part in command], check=True, cwd=tempfile.gettempdir())
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


if __name__ == "__main__":
    main()
