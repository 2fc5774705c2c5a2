"""Invariants of engines: momenta, energy, similarity and place, each with its law, from stored records."""
