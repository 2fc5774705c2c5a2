"""Hypothesis profiles: ``check`` is reproducible and bounded, ``deep`` searches."""

import os

from hypothesis import settings

settings.register_profile("check", max_examples=25, deadline=None, derandomize=True, database=None)
settings.register_profile("deep", max_examples=500, deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "check"))
