"""The command `crosscheck`: what it accepts, what it lists and the tables it prints."""

from crosscheck.cli.commands import main

__all__ = ["main"]
