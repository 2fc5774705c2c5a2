"""Adapter of Newton."""

from crosscheck.engines.newton.adapter import ENGINE

__all__ = ["ENGINE"]
