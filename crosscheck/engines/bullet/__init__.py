"""Adapter of Bullet."""

from crosscheck.engines.bullet.adapter import ENGINE

__all__ = ["ENGINE"]
