"""Adapters of engines, one folder or file for each; the other modules are shared by several adapters."""
