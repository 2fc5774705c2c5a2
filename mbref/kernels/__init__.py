"""Compilation, cache and memory of kernels."""
