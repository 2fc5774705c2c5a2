"""The sparse factor of S + I/α over what moves: its cost grows with the number of joints and no faster."""
