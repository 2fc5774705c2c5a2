"""No stabilisation: constraint violations are left to grow (section 2 of the paper, Figure 2)."""

from mbref.stabilisation.base import Stabilisation
from mbref.stabilisation.full import accept, enter, rates

NONE = Stabilisation("none", "Figure 2", enter, rates, rates, rates, accept)
