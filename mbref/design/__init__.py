"""Analysis of a design: closing of its loops, redundancy along its motion, exchanges of joints,
equilibria."""
