"""Engines on mechanisms with closed loops: which of them close a loop, and how accurately."""
