"""Taylor series of a motion in natural coordinates, one compiled code for every scene."""
