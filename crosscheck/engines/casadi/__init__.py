"""CasADi's generated C code as an engine."""

from crosscheck.engines.casadi.adapter import ENGINE

__all__ = ["ENGINE"]
