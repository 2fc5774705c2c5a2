"""Specialised code: machine code for one scene, recorded from the kernels that serve every scene."""

from mbref.specialised.build import Part, Specialised, specialise
from mbref.specialised.chart import with_specialised_code
from mbref.specialised.tracing import Untraceable
from mbref.specialised.varied import Varied, arrays_of

__all__ = [
    "Part", "Specialised", "Untraceable", "Varied", "arrays_of", "specialise", "with_specialised_code",
]  # fmt: skip
