#!/usr/bin/env bash
# Finding {found.name}: {found.package} {found.version}
#
{words}
#
# Stated: {stated} {found.unit}
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q {packages}

cat > "$place/proof.py" <<'END'
{found.script}END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "{found.package} {found.version}: stated {stated}, seen $seen {found.unit}"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not {holds})' "$seen" || {{
    echo "This has changed."
    exit 1
}}
