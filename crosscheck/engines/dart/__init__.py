"""DART as an engine."""

from crosscheck.engines.dart.adapter import ENGINE

__all__ = ["ENGINE"]
