"""The command `crosscheck`: its options, its lists and the tables it prints."""

from crosscheck.cli.commands import main

__all__ = ["main"]
