"""SDF files as scenes, read without an engine: their joints may close loops themselves."""
