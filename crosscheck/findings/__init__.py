"""Violations found in engines, as records that can be run again and pasted into an engine's issue tracker."""
