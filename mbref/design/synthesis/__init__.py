"""Dimensional synthesis: numbers of a scene whose motion meets goals."""
