"""Hypothesis profiles: ``check`` is reproducible, ``deep`` searches, ``first`` ends at a failure."""

import os

from hypothesis import Phase, settings

settings.register_profile("check", max_examples=25, deadline=None, derandomize=True, database=None)
settings.register_profile("deep", max_examples=500, deadline=None, print_blob=True)
settings.register_profile("first", settings.get_profile("check"), phases=(Phase.generate,))
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "check"))
