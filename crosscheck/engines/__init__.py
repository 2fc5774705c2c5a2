"""One adapter a file; what adapters share stands in graph.py."""
