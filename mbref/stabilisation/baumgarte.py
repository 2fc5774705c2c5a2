"""Baumgarte stabilisation: Φ_q q̈ = γ - 2 α Φ' - β² Φ (Eq. 9), α = β = 5 unless said."""

from collections.abc import Mapping

from mbref.stabilisation.all_coordinates import accept, enter, rates
from mbref.stabilisation.base import Stabilisation


def _feedback(options: Mapping[str, float]) -> tuple[float, float]:
    return 2 * options["alpha"], options["beta"] ** 2


BAUMGARTE = Stabilisation(
    "baumgarte", "Eq. 9", enter, rates, rates, rates, accept, {"alpha": 5.0, "beta": 5.0}, _feedback
)
