"""Alternatives of engines on random mechanisms: differences of ways to solve the same equations."""
