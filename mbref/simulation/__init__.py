"""Simulation of a scene by a method: from the call to the motion, its outcome and its message."""
