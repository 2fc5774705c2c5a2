"""The page on small motions of engines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from crosscheck.small_motions.mechanisms import MECHANISMS
from crosscheck.small_motions.records import FILE, Record, read
from crosscheck.small_motions.sentences import heading, method, search, size, written

from ..blocks import Block, Fold, Heading, Prose, Table

TITLE = "Small motions in engines"
HEAD = """
This page helps to decide which eigenvalues to trust. It compares eigenvalues of small motions about
equilibria and steady motions with closed forms. The eigenvalues are of the judge, of `mbref modes`, of the
functions with which engines linearise, and of the engines' accelerations, by differences that crosscheck
takes. An error is the largest one over all eigenvalues and poses, relative to the largest eigenvalue.

```sh
crosscheck modes my.toml                                  # a mechanism of your own
crosscheck modes                                          # this table, from stored records
crosscheck modes --run --force --page docs/results/small-motions.md  # measure again, and write this page
```
"""
NOTES = """## How to read it

- **judge**: Lagrange multipliers and joint coordinates of a spanning tree in long doubles,
  `crosscheck/judge/small_motions`. Nothing of mbref's equations is called. It searches equilibria by damped
  Newton steps, from poses along the constraints and from random poses, also of other assemblies.
- **mbref modes**: natural frequencies and damping of [`mbref modes`](../equilibrium.md), by differences of
  accelerations along the tangent. The search of `mbref equilibrium` follows the constraints from the scene's
  pose. So it may miss poses of other assemblies; the list of mechanisms says which.
- **ComputeODE2Eigenvalues** (Exudyn): projects mass, damping and stiffness into the null space of the
  constraints. The change of the constraint forces with the pose, which is the stiffness of a pendulum in
  Cartesian coordinates, is not part of its stiffness matrix. So it gives zero for a pendulum under
  gravity ([finding](findings.md#exudyn-eigenvalues-of-pendulum)). It is right where reactions do not turn
  with the bodies, as on slides.
- **mjd_transitionFD** (MuJoCo): central differences of one step of 1e-4 s by its Euler integrator, whose
  error is of first order for dampers. Loops are closed softly, as hard as MuJoCo allows: `solref` 2e-4 s,
  `solimp` 0.9999. With the default `solimp` of 0.9 errors on loops are 0.02 to 0.1. The eigenvalues nearest
  to the exact ones count; the others are decays of the soft closures.
- **accelerations**: central differences of order 4, with an increment of 2e-3 rad or lengths. Right
  accelerations at displaced poses give about 1e-11.
- Functions that linearise are not asked about steady motions.
"""
FOUR_BAR_NAME = "spring_four_bar"
FOUR_BAR = """## The four-bar with a diagonal spring

The IFToMM benchmark "Fourbar linkage with diagonal spring" prints the angle of its equilibrium, 2.23433101898
rad. With a natural length of √2 m the equilibrium is at 2.23433101902 rad, 4e-11 rad from the printed one.
Its printed eigenvalues were not available to us. So the truth is a closed form of the crank's angle φ:
I s² + c d'(φ)² s + V''(φ) = 0 with I = 5/3 kg m², d = 2 cos(φ/2), V = 2 m g sin φ + k (d - √2)²/2. A test
evaluates it with 30 digits (`tests/crosscheck/test_small_motions.py`).
"""


def blocks(records: Path = FILE) -> list[Block]:
    """Return the page of the records in a file."""
    found = read(records)
    about = {mechanism.name: mechanism.about for mechanism in MECHANISMS}
    scenes = dict.fromkeys(record["scene"] for record in found)
    return [
        Prose(HEAD),
        _table(found, list(scenes)),
        Prose("\n".join(_refusals(found))),
        Prose(NOTES),
        Heading("The mechanisms", 2),
        *(Fold(f"{name}: {about.get(name, '')}", name, [Prose(_poses(found, name))]) for name in scenes),
        *([Prose(FOUR_BAR)] if FOUR_BAR_NAME in scenes else []),
    ]


def _table(records: Sequence[Record], scenes: Sequence[str]) -> Table:
    """Return the table of the largest error of each method over the poses of each mechanism."""
    cells: dict[str, dict[str, list[float | None]]] = {}
    for record in records:
        errors = {"judge": record["error"], "mbref modes": record["mbref_error"]}
        errors |= {method(each): each["error"] for each in record["results"] if each["way"]}
        for name, value in errors.items():
            cells.setdefault(name, {}).setdefault(record["scene"], []).append(value)
    first = [name for name in ("judge", "mbref modes") if name in cells]
    rows = [
        (name, *(_largest(cells[name].get(scene, [])) for scene in scenes))
        for name in [*first, *sorted(set(cells) - set(first))]
    ]
    return Table("Largest errors.", ("method", *scenes), rows, frozenset(range(1, 1 + len(scenes))))


def _largest(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return size(max(known)) if known else "–"


def _refusals(records: Sequence[Record]) -> Iterator[str]:
    """Yield a line for each reason why an engine has no eigenvalues."""
    found = {
        (record["scene"], each["engine"], each["reason"]): None
        for record in records
        for each in record["results"]
        if each["reason"]
    }
    yield from (f"- {name} without {scene}: {reason}." for scene, name, reason in sorted(found))


def _poses(records: Sequence[Record], scene: str) -> str:
    return "\n".join(_pose(record) for record in records if record["scene"] == scene)


def _pose(record: Record) -> str:
    listed = ", ".join(written(*s) for s in record["eigenvalues"])
    return f"- {heading(record)}: s = {listed} 1/s. {search(record)}"
