"""Settings of engines for scenes: the order in which engines are asked."""
