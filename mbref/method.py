"""Method: the Taylor series, or a formulation with a stabilisation and an integrator; by name and as objects.

taylor            mpi-svd+projection            lm1+baumgarte[alpha=10,beta=10]/rk4[step=1e-4]
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np

from mbref.formulations import FORMULATIONS
from mbref.formulations.base import Formulation
from mbref.integrators import INTEGRATORS, TAYLOR
from mbref.integrators.base import Integrator
from mbref.kernels.layout import Settings
from mbref.kernels.named_memory import Packed, packed
from mbref.kernels.records import record
from mbref.printable import exact
from mbref.scene.fields import meant
from mbref.scene.structure import has_massless, has_parallel_axes, orientations, without_series
from mbref.stabilisation import STABILISATIONS
from mbref.stabilisation.base import Stabilisation

if TYPE_CHECKING:
    from mbref.scene import Scene

MOST_NAMES = 256  # names whose parsed methods are cached
MOST_ORIENTATIONS = 400  # of runs by `taylor` in place of a sparse run: a step takes a second
# default methods for few and for many bodies
SERIES_METHOD, SPARSE_METHOD = TAYLOR.name, "alf-dual+projection/dop853"
OWN = "own:"  # begins the method's name of a run by a user's own formulation
OLD_SERIES_NAME = "alf-dual+projection/taylor"  # in records of versions up to 0.2
# Largest number of bodies of runs by `taylor` that check or repeat another run
MOST_BODIES = 100
# Largest (variables of `taylor`)³ / bodies for which it is the default, where all axes are parallel, and in
# space; an orientation has two variables. By ``benchmarks/growth.py`` both methods cost the same at 3600 on
# four_bar_chain, 6500 on lattice and 9800 on slider_crank_chain, and at more than 300 000 on sarrus_stack.
MOST_IN_PLANE, MOST_IN_SPACE = 5500.0, 4e5

Part = TypeVar("Part", Formulation, Stabilisation, Integrator)


def default_method(scene: Scene) -> str:
    """Return the name of the default method for a scene: the method that is expected to cost less.

    A step of ``taylor`` costs the third power of the number of different orientations, a step of the sparse
    method ``alf-dual+projection/dop853`` the number of bodies.  With bushings ``taylor`` has no series, with
    massless bodies the sparse method has no matrix, and driven motions need no steps of an integrator.
    """
    bodies = len(scene.body)
    if without_series(scene):
        return SPARSE_METHOD
    if (2.0 * bodies) ** 3 <= MOST_IN_PLANE * bodies:
        return SERIES_METHOD
    if scene.driver or has_massless(scene):
        return crossing_method(scene)
    most = MOST_IN_PLANE if has_parallel_axes(scene) else MOST_IN_SPACE
    return SERIES_METHOD if (2.0 * orientations(scene)) ** 3 <= most * bodies else SPARSE_METHOD


def crossing_method(scene: Scene) -> str:
    """Return ``taylor``, which crosses singular positions, for up to MOST_BODIES bodies without bushings;
    otherwise the sparse method, which ends there."""
    return SERIES_METHOD if len(scene.body) <= MOST_BODIES and not without_series(scene) else SPARSE_METHOD


def may_be_series(scene: Scene) -> bool:
    """Return whether a run by ``taylor`` fits into memory and ends in acceptable time."""
    return orientations(scene) <= MOST_ORIENTATIONS and not without_series(scene)


class MethodError(Exception):
    """Error: a method is unknown, or a part of the method does not have an option."""


@dataclass(frozen=True)
class Method:
    """Formulation, stabilisation and integrator of a run: a row of the paper's tables, and the integrator of
    the run. Or the Taylor series, which needs the reduced equations of ``alf-dual+projection`` only.

    Attributes
    ----------
    formulation : Formulation
        How accelerations and multipliers are computed.
    stabilisation : Stabilisation
        How the constraints are kept.
    integrator : Integrator
        How time steps are taken.
    options : mapping of str to mapping of str to float
        Options by name of the part, where they differ from the defaults.
    """

    formulation: Formulation
    stabilisation: Stabilisation
    integrator: Integrator
    options: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  # keyed by name of the part

    def __str__(self) -> str:
        names = [_text(p.name, self.options.get(p.name, {})) for p in self.parts]
        return names[2] if self.is_series else f"{names[0]}+{names[1]}/{names[2]}"

    @property
    def parts(self) -> tuple[Formulation, Stabilisation, Integrator]:
        """Formulation, stabilisation and integrator."""
        return self.formulation, self.stabilisation, self.integrator

    @property
    def crosses(self) -> Literal["no", "by regularisation", "by series"]:
        """Strategy for crossing singular positions: ``"by series"``, ``"by regularisation"`` or ``"no"``."""
        if self.integrator.crosses != "no":
            return self.integrator.crosses
        return "no" if self.stabilisation.watches_rank else self.formulation.crosses

    @property
    def is_series(self) -> bool:
        """True if the method integrates by Taylor series instead of an explicit integrator."""
        return self.integrator.step is None

    def options_of(self, part: Formulation | Stabilisation | Integrator) -> dict[str, float]:
        """Return the options of one part of the method: its defaults, overridden by the method's name.

        Parameters
        ----------
        part : Formulation, Stabilisation or Integrator
            A part of this method.

        Returns
        -------
        dict of str to float
            Options by name; ``mbref list methods`` prints their units.
        """
        return {**part.options, **self.options.get(part.name, {})}

    def settings(self, rank_tolerance: float) -> Settings:
        """Return the numbers that all kernels share; the feedback gains of both parts are added.

        Parameters
        ----------
        rank_tolerance : float
            Singular value or pivot, relative to the largest one, below which it counts as zero.

        Returns
        -------
        Settings
            Velocity gain (1/s), position gain (1/s²) and rank tolerance.
        """
        gains = np.zeros(2)
        for part in (self.formulation, self.stabilisation):
            if part.feedback is not None:
                gains += part.feedback(self.options_of(part))
        velocity_gain, position_gain = map(float, gains)
        return Settings(velocity_gain, position_gain, rank_tolerance)

    def packed_options(self, part: Formulation | Stabilisation) -> Packed | None:
        """Return the numbers that only this part's kernels need.

        Parameters
        ----------
        part : Formulation or Stabilisation
            A part of this method.

        Returns
        -------
        Packed or None
            The options as a record of numbers; None for a part without options.
        """
        return packed(record(part.numbers(**self.options_of(part)))) if part.options else None

    def with_option(self, name: str, value: float) -> Method:
        """Return the method with another value of one option.

        Parameters
        ----------
        name : str
            Such as ``"alpha"``, or ``"baumgarte.alpha"`` if two parts have an option of this name.
        value : float
            The value, in the option's unit.

        Raises
        ------
        MethodError
            If no part, or more than one, has the option, or the value is not positive.
        """
        part, key = self.option_named(name)
        own = {**self.options.get(part, {}), key: _checked(part, key, value)}
        return replace(self, options={**self.options, part: own})

    def option_named(self, name: str) -> tuple[str, str]:
        """Return the name of the part and of the option that a name means.

        Parameters
        ----------
        name : str
            As for ``with_option``.

        Raises
        ------
        MethodError
            If no part, or more than one, has the option.
        """
        of_part, _, key = name.rpartition(".")
        found = [p for p in self.parts if key in p.options and of_part in ("", p.name)]
        if self.is_series:
            found = [part for part in found if part is self.integrator]
        if len(found) != 1:
            known = [f"{p.name}.{option}" for p in self.parts for option in p.options]
            raise MethodError(f"{self}: {len(found)} parts have an option {name!r}; known: {_listed(known)}")
        return found[0].name, key

    @staticmethod
    @functools.lru_cache(maxsize=MOST_NAMES)
    def parse(name: str) -> Method:
        """Return the method of a name: ``taylor``, or as ``lm1+baumgarte[alpha=10,beta=10]/rk4[step=1e-4]``.

        Parameters
        ----------
        name : str
            ``formulation+stabilisation/integrator``, or ``taylor``. Options stand in brackets. The default
            of the stabilisation is ``none``, of the integrator ``dop853``.

        Raises
        ------
        MethodError
            If a part or an option is unknown (the message lists the known ones), or parts cannot be combined.
        """
        name = name.strip().replace(OLD_SERIES_NAME, SERIES_METHOD)
        options: dict[str, dict[str, float]] = {}
        if name.partition("[")[0] == SERIES_METHOD:
            series = _part(name, {SERIES_METHOD: TAYLOR}, "method", options)
            return Method(FORMULATIONS["alf-dual"], STABILISATIONS["projection"], series, options)
        head, _, integrator = name.partition("/")
        if integrator.partition("[")[0] == SERIES_METHOD:
            raise MethodError(f"{SERIES_METHOD} has no formulation and no stabilisation: use {integrator}")
        names = re.split(r"\+(?![^[]*\])", head, maxsplit=1)  # not at the + of [alpha=1e+5]
        formulation, stabilisation = (*names, "none")[:2]
        parts = (
            _part(formulation, FORMULATIONS, "formulation", options),
            _part(stabilisation, STABILISATIONS, "stabilisation", options),
            _part(integrator or "dop853", INTEGRATORS, "integrator", options),
        )
        return Method(*parts, options)


def _text(name: str, options: Mapping[str, float]) -> str:
    return name + (f"[{','.join(f'{k}={exact(v)}' for k, v in options.items())}]" if options else "")


def _part(text: str, table: Mapping[str, Part], kind: str, options: dict[str, dict[str, float]]) -> Part:
    """Return the part of a method from its table of parts, and put its bracketed options into ``options``."""
    match = re.fullmatch(r"([\w-]+)(?:\[(.*)\])?", text.strip())
    name = match[1] if match else text
    if name not in table:
        raise MethodError(f"unknown {kind} {name!r}; known: {', '.join(table)}{meant(name, table)}")
    part = table[name]
    given = [item for item in (match[2] or "").split(",") if item.strip()] if match else []
    for position, item in enumerate(given):
        key, equals, value = item.partition("=")
        key, value = (key.strip(), value) if equals else (_positional(part, position), key)
        if key in options.get(name, {}):
            raise MethodError(f"{kind} {name}: option {key} is given twice; give it once")
        if key not in part.options:
            raise MethodError(f"{kind} {name} has no option {key!r}; it has: {_listed(part.options)}")
        try:
            number = float(value)
        except ValueError:
            raise MethodError(f"{kind} {name}: option {key} must be a number, got {value!r}") from None
        options.setdefault(name, {})[key] = _checked(f"{kind} {name}", key, number)
    return part


def _checked(part: str, key: str, number: float) -> float:
    """Return the value of a part's option; raises MethodError if it is negative, or a step is zero."""
    if not number >= 0 or (key == "step" and number == 0):
        raise MethodError(f"{part}: option {key} must be positive, got {number:g}")
    return number


def _positional(part: Formulation | Stabilisation | Integrator, position: int) -> str:
    names = list(part.options)
    return names[position] if position < len(names) else f"number {position + 1}"


def _listed(options: Iterable[str]) -> str:
    return ", ".join(options) or "none"
