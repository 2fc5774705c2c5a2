"""Motions recorded by any tool: read from a table, compared with the reference by column, explained."""
