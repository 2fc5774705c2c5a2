"""OndselSolver as an engine."""

from crosscheck.engines.ondsel.adapter import ENGINE

__all__ = ["ENGINE"]
