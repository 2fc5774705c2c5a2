"""Baumgarte stabilisation: Φ_q q̈ = γ - 2 α Φ' - β² Φ (Eq. 9), by default α = β = 5."""

from collections.abc import Mapping
from typing import NamedTuple

from mbref.stabilisation.all_coordinates import accept, enter, rates
from mbref.stabilisation.base import Stabilisation


class Options(NamedTuple):
    """Gains α and β (1/s)."""

    alpha: float = 5.0
    beta: float = 5.0


def _feedback(options: Mapping[str, float]) -> tuple[float, float]:
    return 2 * options["alpha"], options["beta"] ** 2


BAUMGARTE = Stabilisation("baumgarte", enter, rates, rates, accept, numbers=Options, feedback=_feedback)
