"""Tests as other processors would run them: ``python -m tests.machines [TESTS …]``. A setting chooses the
code that OpenBLAS, the kernels' compiler, NumPy and the C library would choose on another processor; a table
says how many tests pass and fail in each. ``--setting own`` runs one of them alone, and ``--ignore-glob`` is
pytest's. ``--motions`` compares the built-in scenes' motions instead, with those of the first setting. Exit
status 1 where a test fails, or where motions differ by more than MOST_APART."""

import argparse
import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parent.parent
KERNELS = ("Haswell", "Zen", "SkylakeX", "Nehalem", "Sandybridge", "Prescott")  # of OpenBLAS
NEEDED = {
    "Haswell": "avx2",
    "Zen": "avx2",
    "SkylakeX": "avx512f",
    "Sandybridge": "avx",
}  # flags of the processor
OLD = {  # no fused multiply-add and no vectors beyond SSE 4.2, as in a processor of 2008
    "OPENBLAS_CORETYPE": "Nehalem",
    "NUMBA_CPU_NAME": "nehalem",
    "NUMBA_CPU_FEATURES": "",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3,X86_V4,AVX512_ICL",
    "XDG_CACHE_HOME": str(ROOT / "build" / "machines" / "nehalem"),
}
SETTINGS: dict[str, dict[str, str]] = {
    "own": {},
    **{f"OpenBLAS {name}": {"OPENBLAS_CORETYPE": name} for name in KERNELS[:4]},
    "all of nehalem": OLD,
}
MOST_APART = 1e-9  # of the mechanism's length, or rad, at the scenes' ends


def environment(changes: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of a process with changes, and with no other setting of a processor."""
    kept = {name: value for name, value in os.environ.items() if name == "XDG_CACHE_HOME" or name not in OLD}
    return {**kept, **changes}


def runs_here(changes: Mapping[str, str]) -> bool:
    """Return whether this processor has the instructions that a setting needs."""
    info = Path("/proc/cpuinfo")
    needed = NEEDED.get(changes.get("OPENBLAS_CORETYPE", ""), "")
    return not needed or (info.exists() and needed in info.read_text().split())


def passed_and_failed(name: str, arguments: Sequence[str]) -> tuple[int, int]:
    """Run pytest in a setting, print its failures, and return how many tests pass and fail."""
    command = [sys.executable, "-m", "pytest", "-q", "-rfE", "--tb=no", "-p", "no:cacheprovider", *arguments]
    given = {"cwd": ROOT, "env": environment(SETTINGS[name])}
    done = subprocess.run(command, capture_output=True, text=True, check=False, **given)
    lines = done.stdout.splitlines()
    for line in lines:
        if line.startswith(("FAILED", "ERROR")):
            print(f"{name}: {line}", flush=True)
    counts = {word: int(count) for count, word in re.findall(r"(\d+) (passed|failed|error)", lines[-1])}
    if done.returncode not in (0, 1) or not counts:
        raise SystemExit(f"{name}: pytest ended with status {done.returncode}\n{done.stdout}{done.stderr}")
    return counts.get("passed", 0), counts.get("failed", 0) + counts.get("error", 0)


def poses_at_the_end(names: Sequence[str]) -> dict[str, list[float]]:
    """Return positions (over the mechanism's length) and quaternions at the ends of scenes, by scene."""
    import mbref
    from crosscheck.judge.constraints import scene_length
    from mbref.scenes import SCENES

    found = {}
    for name in names or SCENES:
        scene = SCENES[name]()
        motion = mbref.simulate(scene, times=[scene.duration])
        found[name] = np.append(motion.position / scene_length(scene), motion.orientation).tolist()
    return found


def motions(chosen: Sequence[str], scenes: Sequence[str]) -> bool:
    """Print how far motions differ from those of the first setting, and return whether that is little."""
    first: dict[str, list[float]] = {}
    largest = 0.0
    print("| setting | scenes equal to the bit | largest difference | scene |")
    print("| --- | --: | --: | --- |")
    for name in chosen:
        command = [sys.executable, "-m", "tests.machines", "--poses", *scenes]
        environ = environment(SETTINGS[name])
        done = subprocess.run(command, cwd=ROOT, env=environ, capture_output=True, text=True, check=True)
        found = json.loads(done.stdout.splitlines()[-1])
        first = first or found
        apart = {scene: float(np.abs(np.subtract(found[scene], first[scene])).max()) for scene in found}
        worst = max(apart, key=lambda scene: apart[scene])
        equal = sum(value == 0.0 for value in apart.values())
        print(f"| {name} | {equal} of {len(apart)} | {apart[worst]:.1e} | {worst if apart[worst] else ''} |")
        largest = max(largest, apart[worst])
    return largest <= MOST_APART


def tests(chosen: Sequence[str], arguments: Sequence[str]) -> bool:
    """Print how many tests pass and fail in each setting, and return whether none fails."""
    table = []
    for name in chosen:
        passed, failed = passed_and_failed(name, arguments)
        table.append((name, passed, failed))
        print(f"| {name} | {passed} | {failed} |", flush=True)
    print("", "| setting | passed | failed |", "| --- | --: | --: |", sep="\n")
    print(*(f"| {name} | {passed} | {failed} |" for name, passed, failed in table), sep="\n")
    return not any(failed for _, _, failed in table)


def main() -> int:
    """Return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.machines", description=__doc__)
    parser.add_argument("names", nargs="*", help="test files and folders, or scenes (default: all)")
    parser.add_argument("--setting", action="append", choices=SETTINGS, help="default: all that run here")
    parser.add_argument("--ignore-glob", action="append", default=[], help="test files that are left out")
    parser.add_argument("--motions", action="store_true", help="compare motions of the built-in scenes")
    parser.add_argument("--poses", action="store_true", help="print the last poses of the built-in scenes")
    asked = parser.parse_args()
    if asked.poses:
        print(json.dumps(poses_at_the_end(asked.names)))
        return 0
    chosen = [name for name in asked.setting or SETTINGS if runs_here(SETTINGS[name])]
    if asked.motions:
        return 0 if motions(chosen, asked.names) else 1
    return 0 if tests(chosen, [*asked.names, *(f"--ignore-glob={glob}" for glob in asked.ignore_glob)]) else 1


if __name__ == "__main__":
    sys.exit(main())
