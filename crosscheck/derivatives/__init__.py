"""Derivatives of accelerations by the functions of engines, against the judge's."""
