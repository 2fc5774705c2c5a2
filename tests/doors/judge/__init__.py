"""Verdicts of `crosscheck judge` on tables of exact and of changed motions."""
