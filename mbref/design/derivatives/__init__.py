"""Derivatives of motions with respect to numbers of the scene."""
