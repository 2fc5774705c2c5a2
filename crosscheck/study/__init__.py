"""A study runs every scene in every engine at every setting, in child processes, and stores raw records."""

from crosscheck.study.grid import Case, Record, study
from crosscheck.study.search.offers import Unable, default_cases

__all__ = ["Case", "Record", "Unable", "default_cases", "study"]
