"""The model-identity gate / engines on one scene with all kinds of loads, several joints and velocities."""

from __future__ import annotations

import pytest

pytestmark = pytest.mark.slow  # engines load for seconds, and the last three compile their code
START, CHANGE = 1e-7, 3e-4  # largest relative differences that single precision leaves
