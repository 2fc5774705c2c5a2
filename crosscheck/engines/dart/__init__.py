"""Adapter of DART."""

from crosscheck.engines.dart.adapter import ENGINE

__all__ = ["ENGINE"]
