"""Ensembles: many scenes by one method, in batches of equal structure and in several processes."""
