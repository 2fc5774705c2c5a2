"""Size and time of the extras: ``python benchmarks/extras.py [EXTRA …]`` installs each in a new environment.

It prints a row of a table for each extra: seconds of ``pip install``, the size of the environment, and the
seconds of the first import of the engines' packages. An environment without extras comes first.
"""

import argparse
import subprocess
import sys
import tempfile
import time
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
    print("| extra | engines | installed in (s) | environment (MB) | first import (s) |")
    print("| --- | --- | --: | --: | --: |")
    asked = parser.parse_args().extra
    if unknown := [extra for extra in asked if extra not in EXTRAS]:
        parser.error(f"no extra {unknown[0]!r}; there are: {', '.join(filter(None, EXTRAS))}")
    for extra in asked:
        row = measured(extra)
        print(f"| {extra or 'none'} | {', '.join(EXTRAS[extra])} | " + " | ".join(row) + " |", flush=True)


def measured(extra: str) -> tuple[str, str, str]:
    """The cells of an extra: seconds of the installation, MB, seconds of the first import."""
    with tempfile.TemporaryDirectory() as folder:
        venv.create(folder, with_pip=True)
        python = Path(folder) / ("Scripts" if sys.platform == "win32" else "bin") / "python"
        wanted = f"{ROOT}[{extra}]" if extra else str(ROOT)
        seconds = timed([python, "-m", "pip", "install", "-q", wanted])
        size = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file()) / 1e6
        loading = timed([python, "-c", IMPORT, *EXTRAS[extra]])
        return f"{seconds:.0f}", f"{size:.0f}", f"{loading:.1f}"


def timed(command: list[object]) -> float:
    """Wall time (s) of a command, which must succeed."""
    start = time.perf_counter()
    subprocess.run([str(part) for part in command], check=True, cwd=tempfile.gettempdir())
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
