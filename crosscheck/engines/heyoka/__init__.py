"""Adapter of heyoka's Taylor series."""

from crosscheck.engines.heyoka.adapter import ENGINE

__all__ = ["ENGINE"]
