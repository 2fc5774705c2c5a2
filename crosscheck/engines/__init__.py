"""Adapters of engines, one folder or file for each; `shared` has the parts that several adapters use."""
