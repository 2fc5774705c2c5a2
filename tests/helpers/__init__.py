"""Makers of scenes, changes of scenes and readers of outputs that several test files use."""
