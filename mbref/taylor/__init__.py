"""Taylor series of a motion in natural coordinates, by kernels for all scenes or by code generated for a
scene."""
