"""The command line of mbref."""

from mbref.cli.commands import main

__all__ = ["main"]
