"""MuJoCo Warp as an engine."""

from crosscheck.engines.warp.adapter import ENGINE

__all__ = ["ENGINE"]
