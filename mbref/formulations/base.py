"""Interface of formulations, which compute accelerations and multipliers from M, Φ_q, g and γ."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

from mbref.kernels.compilation import Exchangeable
from mbref.kernels.records import NoNumbers


class About(NamedTuple):
    """Texts on a formulation, for `mbref list` and the pages of the documentation."""

    title: str
    meaning: str  # one line for `mbref list methods`
    formula: str  # LaTeX
    text: str  # equations of the source, in a sentence
    use: str  # situations that the formulation suits
    fails: str


@dataclass(frozen=True)
class Formulation:
    """A method of solving M q̈ + Φ_qᵀ λ = g, Φ_q q̈ = γ (Eqs. 3 and 4), with its claims as data.

    ``accelerate(system) -> status`` is a kernel that reads a ``layout.System`` and writes its acceleration
    and multipliers; the kernel reads the terms only, never the scene.
    """

    name: str
    about: About
    equations: str  # equation numbers of the paper
    accelerate: Exchangeable
    # schema of the kernel's memory; None for a kernel that reads no dense Jacobian, but a SparseFactor
    scratch: type | None
    handles_redundancy: bool
    handles_singular_mass: bool
    crosses: Literal["no", "by regularisation"] = (
        "no"  # how the formulation crosses a singular position if no stabilisation ends the run
    )
    # True if the formulation needs as many independent rows as coordinates, so no degree of freedom
    needs_independent_columns: bool = False
    # True if dependent rows must not be left out, because the formulation selects or weights rows itself
    needs_all_rows: bool = False
    numbers: type = NoNumbers  # record of the method's own numbers with their defaults
    feedback: Callable[[Mapping[str, float]], tuple[float, float]] | None = None  # gains of Φ' and Φ in γ

    @property
    def is_sparse(self) -> bool:
        """True if the cost is proportional to the number of joints, by a sparse factor."""
        return self.scratch is None

    @cached_property
    def options(self) -> Mapping[str, float]:
        """Names and defaults of the method's numbers."""
        return self.numbers()._asdict()
