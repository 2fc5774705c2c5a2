"""Simbody through OpenSim as an engine."""

from crosscheck.engines.simbody.adapter import ENGINE

__all__ = ["ENGINE"]
