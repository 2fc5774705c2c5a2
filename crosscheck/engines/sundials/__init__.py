"""Adapter of SUNDIALS IDA."""

from crosscheck.engines.sundials.adapter import ENGINE

__all__ = ["ENGINE"]
