"""MJCF and URDF files as scenes: compiled by MuJoCo, posed, read, and compared with the compiled model."""
