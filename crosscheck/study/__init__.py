"""A study: the grid scene × engine × setting, run in child processes, as raw records."""

from crosscheck.study.grid import Case, Record, Unable, default_cases, study

__all__ = ["Case", "Record", "Unable", "default_cases", "study"]
