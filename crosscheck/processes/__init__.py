"""Child processes with time limits, in which engines run: a crash or a hang ends one run only."""
