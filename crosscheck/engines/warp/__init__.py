"""Adapter of MuJoCo Warp."""

from crosscheck.engines.warp.adapter import ENGINE

__all__ = ["ENGINE"]
