"""Adapter of Exudyn."""

from crosscheck.engines.exudyn.adapter import ENGINE

__all__ = ["ENGINE"]
