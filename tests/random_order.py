"""The tests in random order, and in random halves by two processes.

``python -m tests.random_order --times 20 --at-most 0.2`` runs 20 random splits of the tests that took at most
0.2 s, each split in two processes at a time, and prints a line a split; exit status 1 where a test failed.  A
first run of all tests notes how long each takes, in ``build/durations.json``.
As a plugin, ``pytest -p tests.random_order --order-seed 7`` shuffles, ``--half 1`` or ``2`` keeps a half.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
from pathlib import Path

import pytest

DURATIONS = Path(__file__).parents[1] / "build" / "durations.json"


def pytest_addoption(parser: pytest.Parser) -> None:
    """--order-seed, --half and --at-most."""
    parser.addoption("--order-seed", type=int, default=0, help="of the order of the tests")
    parser.addoption("--half", type=int, choices=(1, 2), help="run this half of the tests alone")
    parser.addoption("--at-most", type=float, help="run tests alone that took no longer, in s")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Shuffle, after marks have deselected theirs."""
    whole, longest, half = list(items), config.getoption("at_most"), config.getoption("half")
    if longest is not None:
        took = noted()
        items[:] = [item for item in items if took.get(item.nodeid, 0.0) <= longest]
    random.Random(config.getoption("order_seed")).shuffle(items)
    if half:
        items[:] = items[half - 1 :: 2]
    kept = set(items)
    config.hook.pytest_deselected(items=[item for item in whole if item not in kept])


def noted() -> dict[str, float]:
    """Seconds of every test, as noted by ``note``."""
    return json.loads(DURATIONS.read_text()) if DURATIONS.exists() else {}


def note() -> None:
    """Run all tests, one after another, and note how long each takes."""
    report = DURATIONS.with_name("durations.txt")
    DURATIONS.parent.mkdir(exist_ok=True)
    with report.open("w") as file:
        command = [sys.executable, "-m", "pytest", "-q", "--durations=0", "-vv"]
        subprocess.run(command, cwd=DURATIONS.parents[1], stdout=file, check=True)
    took: dict[str, float] = {}
    for line in report.read_text().splitlines():
        words = line.split(maxsplit=2)
        if len(words) == 3 and words[1] in ("setup", "call", "teardown"):
            took[words[2]] = took.get(words[2], 0.0) + float(words[0].rstrip("s"))
    DURATIONS.write_text(json.dumps(took))


def split(seed: int, options: list[str]) -> tuple[bool, str]:
    """Whether both halves of a random split pass, run at a time, and what pytest says of them."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-p",
        "tests.random_order",
        "--order-seed",
        str(seed),
        *options,
    ]
    halves = [
        subprocess.Popen([*command, "--half", half], stdout=subprocess.PIPE, text=True) for half in "12"
    ]
    said = [half.communicate()[0].splitlines() for half in halves]
    failed = [line for lines in said for line in lines if line.startswith(("FAILED", "ERROR"))]
    text = "; ".join(lines[-1] if lines else "nothing" for lines in said)
    return not any(half.returncode for half in halves), "\n".join([text, *failed])


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.random_order", description=__doc__)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first split")
    parser.add_argument("--at-most", help="s; tests that took longer are left out")
    parser.add_argument("paths", nargs="*", default=["tests"])
    chosen = parser.parse_args()
    options = [] if chosen.at_most is None else ["--at-most", chosen.at_most]
    if options and not DURATIONS.exists():
        note()
    sound = 0
    for seed in range(chosen.first, chosen.first + chosen.times):
        passed, text = split(seed, [*options, *chosen.paths])
        sound += passed
        print(f"split {seed}: {text}", flush=True)
    print(f"{sound} of {chosen.times} random splits over two processes passed")
    return 0 if sound == chosen.times else 1


if __name__ == "__main__":
    sys.exit(main())
