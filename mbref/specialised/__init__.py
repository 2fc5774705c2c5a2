"""Machine code of one scene's own, traced from the kernels that serve every scene."""

from mbref.specialised.build import Specialised, specialise
from mbref.specialised.chart import MOVING_ONLY
from mbref.specialised.tracing import Untraceable

__all__ = ["MOVING_ONLY", "Specialised", "Untraceable", "specialise"]
