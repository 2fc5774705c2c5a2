#!/usr/bin/env bash
# Finding scipy-event-at-end-of-step: scipy 1.17.1
#
# Does: solve_ivp reports one crossing of an event twice if a step ends exactly on it, by every method: a switch at 1
#   s with steps of 0.25 s is in t_events as [1, 1]. A terminal event that counts to 2 ends the run at the first
#   crossing.
# Right: one crossing, as for a switch at 1.1 s.
# Cause: The end of one step, where the event is 0, and the start of the next count as a crossing each: the test is g
#   <= 0 <= g_new. Steps end on events where max_step divides the time of a switch.
#
# Stated: 1 crossings too many
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q scipy==1.17.1 numpy

cat > "$place/proof.py" <<'END'
from scipy.integrate import solve_ivp


def crossings(method, switch):
    """Return how often solve_ivp reports a switch at a time (s) in a motion of 2 s with steps of 0.25 s."""
    events = [lambda t, y: t - switch]
    run = solve_ivp(
        lambda t, y: [1.0], (0.0, 2.0), [0.0], method, events=events, max_step=0.25, first_step=0.25
    )
    return len(run.t_events[0])


methods = ["RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"]
assert [crossings(method, 1.1) for method in methods] == [1] * 6
print(min(crossings(method, 1.0) for method in methods) - 1)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "scipy 1.17.1: stated 1, seen $seen crossings too many"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1) <= 0.1)' "$seen" || {
    echo "This has changed."
    exit 1
}
