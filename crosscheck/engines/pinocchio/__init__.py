"""Pinocchio as an engine."""

from crosscheck.engines.pinocchio.adapter import ENGINE

__all__ = ["ENGINE"]
