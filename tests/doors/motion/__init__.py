"""Motions of mbref against exact motions and balances."""
