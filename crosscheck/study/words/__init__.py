"""The verdict of a comparison in sentences, computed from records."""
