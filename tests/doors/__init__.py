"""Tests through doors: the public interface, command lines and files; each states a truth about an output."""
