"""Drake as an engine."""

from crosscheck.engines.drake.adapter import ENGINE

__all__ = ["ENGINE"]
