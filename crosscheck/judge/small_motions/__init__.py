"""Equilibria, steady motions and small motions about them, by the judge's own equations."""
