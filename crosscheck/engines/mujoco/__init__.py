"""Adapter of MuJoCo."""

from crosscheck.engines.mujoco.adapter import ENGINE

__all__ = ["ENGINE"]
