"""Adapters, one folder or file for each engine; the modules beside them are shared by several."""
