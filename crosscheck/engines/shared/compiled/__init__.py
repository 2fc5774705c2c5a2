"""Compiled integrators around the accelerations of engines, without Python between two samples of a run."""
