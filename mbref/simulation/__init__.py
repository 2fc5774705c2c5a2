"""Simulation: method, run, compiled stepping loop, singular positions, ensembles."""
