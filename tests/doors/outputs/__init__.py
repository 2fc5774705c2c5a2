"""Numbers, tables, files and pictures of motions."""
