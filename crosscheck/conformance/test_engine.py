"""Tests of an engine by the conformance suite, collected by ``pytest --pyargs crosscheck.conformance --engine
NAME``."""

from __future__ import annotations

import pytest

from crosscheck.conformance.suite import Verdict


def test_check(crosscheck_verdict: Verdict) -> None:
    """Test one check on one scene; it is skipped with a reason if it does not apply."""
    verdict = crosscheck_verdict
    if verdict.status == "expected":
        pytest.xfail(verdict.reason)
    if verdict.status in ("cannot", "outside"):
        pytest.skip(f"{verdict.status}: {verdict.reason}")
    measured = "" if verdict.measured is None else f" {verdict.measured:.3g}, allowed {verdict.allowed:.3g}"
    assert verdict.status == "pass", f"{verdict.scene}: {verdict.check()}{measured} {verdict.reason}"
