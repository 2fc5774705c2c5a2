"""Engines on mechanisms with closed loops: which engines keep the joints of the loops closed, and how
accurate their motions are."""
