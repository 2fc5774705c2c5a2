"""The command line of mbref."""

from mbref.imports import without_collection

with without_collection():
    from mbref.cli.commands import main

__all__ = ["main"]
