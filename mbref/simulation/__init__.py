"""Simulation of a scene by a method: from the call to the motion, its outcome and its message."""

VERSION = "0.2.0"  # of mbref, stored with each run
