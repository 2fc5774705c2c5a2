"""An engine / every card: collected by ``pytest --pyargs crosscheck.conformance --engine NAME``."""

from __future__ import annotations

import pytest

from crosscheck.conformance.suite import Verdict


def test_card(crosscheck_verdict: Verdict) -> None:
    """A card fails, passes, or is skipped with the reason why it says nothing here."""
    verdict = crosscheck_verdict
    if verdict.status in ("cannot", "outside"):
        pytest.skip(f"{verdict.status}: {verdict.reason}")
    measured = "" if verdict.measured is None else f" {verdict.measured:.3g}, allowed {verdict.allowed:.3g}"
    assert verdict.status == "pass", f"{verdict.scene}: {verdict.card()}{measured} {verdict.reason}"
