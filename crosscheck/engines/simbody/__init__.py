"""Adapter of Simbody through OpenSim."""

from crosscheck.engines.simbody.adapter import ENGINE

__all__ = ["ENGINE"]
