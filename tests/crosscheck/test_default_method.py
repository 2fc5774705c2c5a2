"""mbref as an engine / the default method at quick depth."""

from crosscheck.engine import engine
from crosscheck.study.search.offers import default_cases
from crosscheck.study.search.selection import of_few_families
from mbref.method import default_method
from mbref.scenes import SCENES


def test_a_quick_comparison_has_mbref_at_its_default_method():
    for scene in (SCENES["four_bar_gravity"](), SCENES["four_bar_chain"]().with_(name="chain")):
        cases, _ = default_cases(scene, ["mbref"])
        families = dict.fromkeys(case.setting.family for case in of_few_families(cases))
        default = default_method(scene).removesuffix("/dop853")
        assert default in families, (default, list(families))
        assert engine("mbref").best_settings(scene)[0].family == default


def test_mbref_prepares_its_kernels_before_it_is_asked_for_settings(monkeypatch):
    """`prepare` compiles in two processes; a question would compile in one process."""
    mbref, done = engine("mbref"), []
    monkeypatch.setattr(mbref, "prepare", lambda families: done.append("prepare"), raising=False)
    monkeypatch.setattr(mbref, "serves", lambda scene, family: bool(done.append("serves")), raising=False)
    assert mbref.settings(SCENES["four_bar"]()) == []
    assert done[0] == "prepare" and done.count("prepare") == 1 and "serves" in done
