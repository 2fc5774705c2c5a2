"""Machine code of one scene's own, traced from kernels that serve every scene."""

from mbref.specialised.build import Part, Specialised, specialise
from mbref.specialised.chart import with_own_code
from mbref.specialised.tracing import Untraceable

__all__ = ["Part", "Specialised", "Untraceable", "specialise", "with_own_code"]
