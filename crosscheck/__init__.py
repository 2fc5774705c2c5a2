"""crosscheck: simulate a mechanism in several engines and compare each motion with the true motion.

The public names are imported at first access, so that ``import crosscheck`` takes little time.
``find_engine`` is the function ``crosscheck.engine.engine`` and ``run_study`` the function
``crosscheck.study.study``. Under their own names both functions would be hidden by the modules ``engine`` and
``study``.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from crosscheck.cli.comparison import Comparison, compare
    from crosscheck.engine import Cannot, Engine, Owner, Setting, Supports, default_engines, engine_names
    from crosscheck.engine import engine as find_engine
    from crosscheck.judge.metrics import METRICS, measure
    from crosscheck.judge.truth import Truth, truth_for
    from crosscheck.recorded.exact import reference_table
    from crosscheck.recorded.judgement import judge_motion
    from crosscheck.study import Case, default_cases
    from crosscheck.study import study as run_study

_PLACE_OF = {
    "Cannot": ("crosscheck.engine", "Cannot"),
    "Comparison": ("crosscheck.cli.comparison", "Comparison"),
    "Case": ("crosscheck.study", "Case"),
    "Engine": ("crosscheck.engine", "Engine"),
    "METRICS": ("crosscheck.judge.metrics", "METRICS"),
    "Owner": ("crosscheck.engine", "Owner"),
    "Setting": ("crosscheck.engine", "Setting"),
    "Supports": ("crosscheck.engine", "Supports"),
    "Truth": ("crosscheck.judge.truth", "Truth"),
    "compare": ("crosscheck.cli.comparison", "compare"),
    "default_cases": ("crosscheck.study", "default_cases"),
    "default_engines": ("crosscheck.engine", "default_engines"),
    "engine_names": ("crosscheck.engine", "engine_names"),
    "find_engine": ("crosscheck.engine", "engine"),
    "measure": ("crosscheck.judge.metrics", "measure"),
    "judge_motion": ("crosscheck.recorded.judgement", "judge_motion"),
    "reference_table": ("crosscheck.recorded.exact", "reference_table"),
    "run_study": ("crosscheck.study", "study"),
    "truth_for": ("crosscheck.judge.truth", "truth_for"),
}

__all__ = [
    "METRICS",
    "Cannot",
    "Case",
    "Comparison",
    "Engine",
    "Owner",
    "Setting",
    "Supports",
    "Truth",
    "compare",
    "default_cases",
    "default_engines",
    "engine_names",
    "find_engine",
    "judge_motion",
    "measure",
    "reference_table",
    "run_study",
    "truth_for",
]


def __getattr__(name: str) -> Any:
    if name in _PLACE_OF:
        module, attribute = _PLACE_OF[name]
        return getattr(import_module(module), attribute)
    raise AttributeError(f"module 'crosscheck' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
