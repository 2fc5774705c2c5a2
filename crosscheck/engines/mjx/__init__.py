"""Adapter of MuJoCo MJX."""

from crosscheck.engines.mjx.adapter import ENGINE

__all__ = ["ENGINE"]
