"""Motions: trajectories and numbers, files and pictures that follow from a trajectory and its scene."""
