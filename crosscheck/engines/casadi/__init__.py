"""Adapter of CasADi's generated C code."""

from crosscheck.engines.casadi.adapter import ENGINE

__all__ = ["ENGINE"]
