#!/usr/bin/env bash
# Prove findings in engines without mbref and crosscheck:
#
#     findings/prove.sh                                   list the findings that have a script
#     findings/prove.sh pinocchio-impulse-of-two-joints   prove one or more of them
#
# A proof installs the engine's package, at the version of the finding, into a temporary environment, runs the
# script of crosscheck/findings/findings.toml there, and prints what the engine does, what is right, and the
# number that was stated and that the script prints. It needs Python 3.11 or later, with venv, and a package index.
# Exit status: 0 if every number is as stated, 1 if one has changed.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT

python3 - "$here/../crosscheck/findings/findings.toml" "$place" "$@" <<'END'
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

DIFFERENT = 0.1  # relative difference of a number from the stated one that counts as a change


def proved(finding: dict, place: Path) -> bool:
    """Prove a finding in an environment of its own; return whether its number is as stated."""
    package = f"{finding['package']}=={finding['version']}"
    print(f"{finding['name']}: {package}\n  does:  {finding['does']}\n  right: {finding['right']}", flush=True)
    python = place / finding["name"] / "bin" / "python"
    venv.create(place / finding["name"], with_pip=True)
    subprocess.run([python, "-m", "pip", "install", "-q", package, "numpy"], check=True)
    ran = subprocess.run([python, "-"], input=finding["script"], text=True, stdout=subprocess.PIPE)
    if ran.returncode:
        print(f"  the script ends with exit status {ran.returncode}: changed")
        return False
    seen, stated = float(ran.stdout.split()[-1]), finding.get("measured")
    if stated is None:
        holds, words = seen > finding["wrong_above"], f"more than {finding['wrong_above']:g}"
    else:
        holds, words = abs(seen - stated) <= DIFFERENT * abs(stated), f"{stated:g}"
    print(f"  stated {words} {finding['unit']}, seen {seen:.3g}: {'as stated' if holds else 'changed'}")
    return holds


file, place, *names = sys.argv[1:]
with open(file, "rb") as text:
    known = {each["name"]: each for each in tomllib.load(text)["finding"] if "script" in each}
if unknown := [name for name in names if name not in known]:
    sys.exit(f"no finding with a script: {', '.join(unknown)}")
if not names:
    print(*known, sep="\n")
sys.exit(not all([proved(known[name], Path(place)) for name in names]))
END
