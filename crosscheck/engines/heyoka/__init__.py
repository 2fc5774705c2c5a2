"""heyoka's Taylor series as an engine."""

from crosscheck.engines.heyoka.adapter import ENGINE

__all__ = ["ENGINE"]
