"""Settings of engines: a family of settings and its options."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

# name of the option that chooses the branch at a singular position, in engines that have such an option
BRANCHES = "branches"
# family of the most accurate settings of an engine, in engines that have a family of this name
BEST = "tuned"
AS_IN_FILE = "as in file"  # family that runs the file from which a scene was read, at the file's own settings
ORIGIN = ("file", "import")  # options of "as in file": path of the file, options for reading
TOLERANCES = ("rtol", "accuracy")  # options of families with error-controlled steps
TIMED = {"step": 1, "min_step": 1, "beta": -1}  # options with the unit s, and with 1/s
# part of a method (such as "integrators") → name → its options with their defaults
FamilyParts = Mapping[str, Mapping[str, Mapping[str, float]]]


@dataclass(frozen=True)
class Setting:
    """One way of running an engine.

    Attributes
    ----------
    family : str
        Group of settings that differ in accuracy only. ``"defaults"`` is the library's own choice,
        ``"tuned"`` the most accurate one that its documentation allows.
    options : mapping of str to Any
        Numbers of the engine. Family and options reproduce the run.
    """

    family: str
    options: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.family + "".join(f" {k}={option_text(v)}" for k, v in self.options.items())


@dataclass(frozen=True)
class Alternatives:
    """Several ways in which an engine solves the same equations.

    Attributes
    ----------
    ways : mapping of str to Setting
        Complete settings by name. The first one is the way of which the engine's author is surest.
    within : float
        Largest relative difference of accelerations, reactions and velocities after a short motion.
    """

    ways: Mapping[str, Setting]
    within: float = 1e-9


def option_text(value: Any) -> str:
    """Return the value of an option as text, a number in its shortest form."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def best_family(settings: Sequence[Setting]) -> list[Setting]:
    """Return the settings of the family "tuned", or of the first family of settings if the engine has no such
    family, coarse to fine."""
    families = [setting.family for setting in settings]
    best = BEST if BEST in families or not families else families[0]
    return [setting for setting in settings if setting.family == best]


def unknown_family(engine: str, family: str) -> ValueError:
    """Return the error of a family of settings that an engine does not have."""
    return ValueError(f"{engine} has no family of settings {family!r}; see `crosscheck list settings`")


def fineness(setting: Setting) -> float:
    """Return the step (s) or the tolerance of a setting; 1 if it has neither."""
    return float(next((setting.options[n] for n in ("step", *TOLERANCES) if n in setting.options), 1.0))


def slowed(setting: Setting, factor: float) -> Setting:
    """Return a setting for a motion that takes ``factor`` times as long: steps, and rates of decay."""
    changed = {n: setting.options[n] * factor**k for n, k in TIMED.items() if n in setting.options}
    return Setting(setting.family, {**setting.options, **changed})
