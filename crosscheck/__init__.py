"""crosscheck: the same mechanism in several engines, against truth."""
