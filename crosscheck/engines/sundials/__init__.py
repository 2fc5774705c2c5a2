"""SUNDIALS IDA as an engine."""

from crosscheck.engines.sundials.adapter import ENGINE

__all__ = ["ENGINE"]
