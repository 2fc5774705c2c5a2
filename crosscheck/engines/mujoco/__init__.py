"""MuJoCo as an engine."""

from crosscheck.engines.mujoco.adapter import ENGINE

__all__ = ["ENGINE"]
