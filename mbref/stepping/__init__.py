"""One run: its memory, limits and ranks, and the compiled loop of steps by explicit integrators."""
