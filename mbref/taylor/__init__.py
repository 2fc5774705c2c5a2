"""Taylor series of a motion in natural coordinates, by kernels for every scene or code of a scene's own."""
