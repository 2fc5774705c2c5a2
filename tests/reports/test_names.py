"""Names in file names, Markdown and pages of the report."""

from __future__ import annotations

import pytest

from mbref.files import file_name
from reports.blocks import Heading, Table
from reports.render import html, markdown


def test_plain_names_are_file_names():
    assert file_name("four_bar-speed") == "four_bar-speed"


@pytest.mark.parametrize("name", ["../../up", "a/b", "..", "", "a\nb", "<b>", "x" * 300, "C:\\x"])
def test_other_names_stay_in_their_folder(name: str):
    found = file_name(name)
    assert found.replace("-", "").replace("_", "").isalnum() and len(found) < 100
    assert found != file_name(name + " ")


def test_tags_and_line_ends_in_names_are_words():
    table = Table("caption", ("Engine",), [("<script>|a\nb",)], right=frozenset())
    blocks = [Heading("<b>\nname"), table]
    assert "&lt;script>\\|a b" in markdown(blocks) and "&lt;b> name" in markdown(blocks)
    page = html(blocks, {})
    assert "<script>|" not in page and "&lt;b&gt;" in page and "<b> name" not in page
