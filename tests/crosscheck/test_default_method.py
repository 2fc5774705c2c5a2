"""mbref as an engine: its default method at quick depth."""

from crosscheck.engine import engine
from crosscheck.study.search.offers import default_cases
from crosscheck.study.search.selection import of_few_families
from mbref.scenes import SCENES


def test_a_quick_comparison_runs_mbref_at_its_default_method():
    """The Taylor series is the default of small mechanisms. It is among the few families of quick depth, and
    is the first of the engine's best settings."""
    scene = SCENES["four_bar_gravity"]()
    families = {case.setting.family for case in of_few_families(default_cases(scene, ["mbref"])[0])}
    assert "taylor" in families and engine("mbref").best_settings(scene)[0].family == "taylor"
