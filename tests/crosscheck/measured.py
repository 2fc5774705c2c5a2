"""How far engines may be off in a test: MARGIN times the largest error that was measured where it runs.

A test states the measured errors; whoever makes them smaller writes the new ones down.
"""

from __future__ import annotations

MARGIN = 10.0  # for other processors, and other versions of libraries
ROUNDING = 1e-14  # stands for measured errors that are smaller
