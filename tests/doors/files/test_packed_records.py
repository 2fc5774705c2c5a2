"""Packed records of a report, and compressed files of records: read as the files are; damage is named."""

import lzma
import subprocess
import sys
from pathlib import Path

import pytest

from crosscheck.cli import main as crosscheck
from mbref.records import RecordsError, looked_at, rewrite, stored
from mbref.scenes import SCENES
from reports.__main__ import main as report
from tests.fuzz.broken_files import RECORD

REPORTS = Path(__file__).parents[3] / "reports"


def test_a_packed_folder_renders_as_the_folder_itself_and_has_equal_records(tmp_path, capsys):
    """`python -m reports.keep` packs a folder of one record; `diff` compares the records."""
    plain, packed = tmp_path / "plain", tmp_path / "packed"
    (plain / "scenes").mkdir(parents=True)
    SCENES["four_bar"]().save(plain / "scenes" / "four_bar.toml")
    rewrite(plain / "records.jsonl", [RECORD])
    command = [sys.executable, "-m", "reports.keep", str(plain), str(packed)]
    subprocess.run(command, cwd=REPORTS.parent, check=True, capture_output=True)
    assert [path.name for path in packed.iterdir()] == ["records.zip"]
    assert crosscheck(["diff", str(plain), str(packed)]) == 0
    assert "0 of 1 runs of both sets changed" in " ".join(capsys.readouterr().out.split())
    for place in (plain, packed):
        assert report(["--render", str(place), "--section", "records"]) == 0
    assert (packed / "report.md").read_text() == (plain / "report.md").read_text()


@pytest.mark.parametrize("words", [["--section", "paper"], []], ids=["paper", "all sections"])
def test_a_report_folder_without_the_records_of_the_section_is_named(words, capsys):
    """The committed folder has records of the stability ladders alone, not of the paper or a report."""
    assert report(["--render", str(REPORTS / "stability"), *words]) == 2
    assert str(REPORTS / "stability") in capsys.readouterr().err


def test_a_damaged_pack_is_named_in_one_sentence(tmp_path, capsys):
    """The last 100 bytes of a committed pack are missing."""
    (tmp_path / "records.zip").write_bytes((REPORTS / "kinds" / "records.zip").read_bytes()[:-100])
    assert report(["--render", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert "records.zip: is damaged" in said and said.count("\n") == 1


def test_a_compressed_file_of_records_is_read_and_refused_where_records_are_added(tmp_path):
    """The suffix .xz compresses: the file begins with the byte FD of that format."""
    path = tmp_path / "records.jsonl.xz"
    rewrite(path, [RECORD])
    assert list(looked_at(path).values()) == [RECORD] and path.read_bytes()[:1] == b"\xfd"
    with pytest.raises(RecordsError, match=r"records\.jsonl\.xz: is compressed"):
        stored(path)


def test_a_damaged_compressed_file_of_records_is_named(tmp_path, capsys):
    """The last nine bytes are missing, or a whole file holds other text than records."""
    path = tmp_path / "records.jsonl.xz"
    rewrite(path, [RECORD])
    cut, other = path.read_bytes()[:-9], lzma.compress(b"no record\n")
    for content, says in ((cut, "is damaged"), (other, "holds no records")):
        path.write_bytes(content)
        assert crosscheck(["convergence", "--records", str(path)]) == 2
        said = capsys.readouterr().err
        assert "records.jsonl.xz: " in said and says in said and said.count("\n") == 1


def test_committed_reports_have_at_most_6_megabytes_and_no_record_outside_a_pack():
    """A clone stays small. Pictures and pages, which are made from the records, do not count."""
    paths = [path for path in REPORTS.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    kept = [path for path in paths if path.suffix != ".png" and path.name != "index.html"]
    assert sum(path.stat().st_size for path in kept) < 6e6
    assert not [path for path in kept if path.suffix in (".jsonl", ".json")]
