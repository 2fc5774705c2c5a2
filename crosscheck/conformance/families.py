"""The family of settings by which an engine is judged."""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.engine import Setting

BEST = "tuned"  # the family an engine calls its best; without it, its first family counts as that


def best_family(settings: Sequence[Setting]) -> list[Setting]:
    """The settings of the family an engine calls its best, else of its first family, coarse to fine."""
    families = [setting.family for setting in settings]
    best = BEST if BEST in families or not families else families[0]
    return [setting for setting in settings if setting.family == best]
