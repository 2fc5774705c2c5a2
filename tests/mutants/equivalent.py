"""Mutants that change nothing that a program could observe, each with the reason."""

from __future__ import annotations

from tests.mutants.operators import Mutant

ERRORS = "position_error_series(scene, trajectory, exact), rotation_error_series(scene, trajectory, exact)"
REASONS: dict[tuple[str, str, str], str] = {
    ("crosscheck/judge/metrics.py", ERRORS, "position_error_series(scene, exact, trajectory)"): (
        "The distance of two points is the same in both directions."
    ),
    ("crosscheck/judge/metrics.py", ERRORS, "rotation_error_series(scene, exact, trajectory)"): (
        "The angle between two orientations is the same in both directions."
    ),
    (
        "crosscheck/engines/mujoco/importing/agreement.py",
        'self._same(ours, data.qfrc_bias - data.qfrc_passive, "bias forces")',
        "self._same(data.qfrc_bias - data.qfrc_passive, ours, 'bias forces')",
    ): "The comparison treats both arrays alike.",
    (
        "crosscheck/judge/truth/crankshaft.py",
        'return Path("crankshaft", poses, paths[0].axis, turning_driver(scene, paths[0].axis, turns))',
        "1",
    ): "All cranks of a crankshaft turn about one axis, since `one_dof` refuses every other path.",
    (
        "mbref/equations/joint_reactions.py",
        "if not place.part or place.of not in names:",
        "(place.of not in names)",
    ): "A primitive that is no part of a coupling or an armature names no joint in its field ``of``.",
}
"""By file, the line of the source and the new text of the mutant."""


def reason(mutant: Mutant, source: str) -> str:
    """Return why a mutant of a source changes nothing; empty where it does."""
    line = source.splitlines()[mutant.line - 1].strip()
    return REASONS.get((mutant.file, line, mutant.new), "")
