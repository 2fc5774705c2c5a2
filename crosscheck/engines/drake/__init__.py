"""Adapter of Drake."""

from crosscheck.engines.drake.adapter import ENGINE

__all__ = ["ENGINE"]
