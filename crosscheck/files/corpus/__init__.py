"""Small files with one feature each, written for this table, and what is right for each of them."""

from __future__ import annotations

from crosscheck.files.corpus import mjcf, sdf, urdf

CASES = (*mjcf.CASES, *urdf.CASES, *sdf.CASES)
