"""The paper's tables and figures as data, and the runs that repeat them with one set of settings."""
