"""mbref as an engine: its default method at quick depth."""

from crosscheck.engine import engine
from crosscheck.study.search.offers import default_cases
from crosscheck.study.search.selection import of_few_families
from mbref.method import default_method
from mbref.scenes import SCENES


def test_a_quick_comparison_runs_mbref_at_its_default_method():
    """The default method of a scene without and with redundant rows is among the few families of quick
    depth, and is the first of the engine's best settings."""
    for scene in (SCENES["four_bar_gravity"](), SCENES["four_bar_chain"]().with_(name="chain")):
        cases, _ = default_cases(scene, ["mbref"])
        families = dict.fromkeys(case.setting.family for case in of_few_families(cases))
        default = default_method(scene).removesuffix("/dop853")
        assert default in families, (default, list(families))
        assert engine("mbref").best_settings(scene)[0].family == default
