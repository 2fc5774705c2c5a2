"""Stabilisations by name."""

from mbref.stabilisation.base import Stabilisation
from mbref.stabilisation.baumgarte import BAUMGARTE
from mbref.stabilisation.none import NONE
from mbref.stabilisation.partitioning import PARTITIONING
from mbref.stabilisation.projection import PROJECTION

STABILISATIONS: dict[str, Stabilisation] = {s.name: s for s in (NONE, BAUMGARTE, PARTITIONING, PROJECTION)}
