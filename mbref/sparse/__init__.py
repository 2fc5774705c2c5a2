"""Large scenes: the sparse factor of S + I/α, whose cost grows with the number of joints and no faster."""
