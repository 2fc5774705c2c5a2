"""The paper's tables and figures as data, and the runs that make them again with one set of settings."""
