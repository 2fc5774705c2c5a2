"""Adapter of Pinocchio."""

from crosscheck.engines.pinocchio.adapter import ENGINE

__all__ = ["ENGINE"]
