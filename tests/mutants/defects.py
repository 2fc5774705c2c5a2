"""One-line defects to plant, each with the tests that have to see it.

Chosen for what a report would silently get wrong: signs, factors, phases and frames in the equations,
exchanged options, units, labels and cells, least against median and wall against processor time, keys,
samples and order of records, checks at the doors.  Where two places compute the same (kernel, adapter,
judge), each has its own.  A reading is what somebody planted who had not written the tests; its survivors
stay, with the tests that were written for them.
"""

from __future__ import annotations

from tests.mutants import of_crosscheck, of_mbref, second_reading, third_reading
from tests.mutants.defect import Defect

DEFECTS: tuple[Defect, ...] = (
    *of_mbref.DEFECTS,
    *of_crosscheck.DEFECTS,
    *second_reading.DEFECTS,
    *third_reading.DEFECTS,
)
