"""Pages of the documentation that are made from stored records, each a function that returns blocks."""
