"""MuJoCo MJX as an engine."""

from crosscheck.engines.mjx.adapter import ENGINE

__all__ = ["ENGINE"]
