"""No stabilisation: constraint violations grow (section 2 of the paper, Figure 2)."""

from mbref.stabilisation.all_coordinates import accept, enter, rates
from mbref.stabilisation.base import Stabilisation

NONE = Stabilisation("none", enter, rates, rates, accept)
