"""SDF files as scenes, read without an engine. Joints of an SDF file may close loops."""
