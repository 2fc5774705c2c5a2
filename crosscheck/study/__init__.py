"""A study runs every scene in every engine at every setting, in child processes, and stores raw records."""

from crosscheck.study.grid import Case, Record, Unable, default_cases, study

__all__ = ["Case", "Record", "Unable", "default_cases", "study"]
