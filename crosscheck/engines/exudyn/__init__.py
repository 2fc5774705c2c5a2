"""Exudyn as an engine."""

from crosscheck.engines.exudyn.adapter import ENGINE

__all__ = ["ENGINE"]
