"""Motions recorded by any tool: read from a table, compared with the reference column by column, and
explained."""
