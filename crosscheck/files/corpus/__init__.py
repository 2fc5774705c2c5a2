"""Small files with one feature each, written for this table, and what is right for each of them."""

from __future__ import annotations

from crosscheck.files.corpus import mjcf, mjcf_equalities, sdf, sdf_models, urdf

CASES = (*mjcf.CASES, *mjcf_equalities.CASES, *urdf.CASES, *sdf.CASES, *sdf_models.CASES)
