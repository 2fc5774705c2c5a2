"""Adapter of OndselSolver."""

from crosscheck.engines.ondsel.adapter import ENGINE

__all__ = ["ENGINE"]
