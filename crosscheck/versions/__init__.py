"""Two versions of an engine's package: an environment for each, equal commands in both, and changes."""
