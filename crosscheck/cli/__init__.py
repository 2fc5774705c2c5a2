"""The command `crosscheck`: its options, its lists and the tables it prints."""

from mbref.imports import without_collection

with without_collection():
    from crosscheck.cli.commands import main

__all__ = ["main"]
