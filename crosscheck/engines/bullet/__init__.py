"""Bullet as an engine."""

from crosscheck.engines.bullet.adapter import ENGINE

__all__ = ["ENGINE"]
