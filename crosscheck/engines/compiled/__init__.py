"""Engines' accelerations in a compiled integrator: no Python between two samples of a run."""
