"""Output files: complete or unchanged, in their folder, and over a file that exists only by --force."""

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import mbref
from crosscheck.cli import main as crosscheck
from mbref.cli import main

RUN = ["four_bar", "--duration", "0.01", "--samples", "3"]
WRITERS = {  # command → words, with the file at the end
    "new": ["new"],
    "draw": ["draw", "four_bar", "--out"],
    "run": ["run", *RUN, "--estimate", "no", "--out"],
    "plot": ["plot", *RUN, "--out"],
    "assemble": ["assemble", "four_bar", "--out"],
}
REFERENCE = ["reference", "four_bar", "--samples", "6", "--out"]
SUFFIX = {"draw": ".png", "run": ".csv", "plot": ".svg", "reference": ".csv"}


@contextmanager
def full_disk(size: int) -> Iterator[None]:
    """Let each file have at most that many bytes, as on a full disk."""
    before, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.getsignal(signal.SIGXFSZ)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.parametrize("command", WRITERS)
def test_file_that_exists_is_replaced_only_with_force(command, tmp_path, capsys):
    """Without --force a command returns 2, names the file and the option in one line, and writes nothing."""
    out = tmp_path / f"out{SUFFIX.get(command, '.toml')}"
    out.write_text("my own")
    assert main([*WRITERS[command], str(out)]) == 2
    assert out.read_text() == "my own"
    said = capsys.readouterr().err
    assert str(out) in said and "--force" in said and said.count("\n") == 1
    assert main([*WRITERS[command], str(out), "--force"]) == 0
    assert out.read_bytes() != b"my own" and [*tmp_path.iterdir()] == [out]


@pytest.mark.parametrize("command", ["draw", "run", "assemble", "reference"])
def test_full_disk_leaves_no_part_of_a_file_and_a_file_that_existed_unchanged(command, tmp_path, capsys):
    """The operating system lets no file have more than 100 bytes."""
    out = tmp_path / f"out{SUFFIX.get(command, '.toml')}"
    program, words = (main, WRITERS[command]) if command in WRITERS else (crosscheck, REFERENCE)
    with full_disk(100):
        assert program([*words, str(out)]) == 2
    said = capsys.readouterr().err
    assert str(out) in said and "Traceback" not in said and not [*tmp_path.iterdir()]
    out.write_text("my own")
    with full_disk(100):
        assert program([*words, str(out), "--force"]) == 2
    assert out.read_text() == "my own" and [*tmp_path.iterdir()] == [out]


def test_table_is_written_through_a_link_into_its_target_which_keeps_its_permissions(tmp_path):
    target, link = tmp_path / "target.csv", tmp_path / "link.csv"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    mbref.simulate("four_bar", times=[0.0, 0.01]).to_csv(link)
    assert link.is_symlink() and target.read_text().startswith("time,")
    assert target.stat().st_mode & 0o777 == 0o640


def test_picture_with_the_default_name_is_replaced_only_with_force(tmp_path, monkeypatch, capsys):
    """The default name is the scene's, with .svg."""
    monkeypatch.chdir(tmp_path)
    picture = tmp_path / "four_bar.svg"
    picture.write_text("my own")
    assert main(["draw", "four_bar"]) == 2
    assert "four_bar.svg: exists already" in capsys.readouterr().err and picture.read_text() == "my own"
    assert main(["draw", "four_bar", "--force"]) == 0 and "<svg" in picture.read_text()


def test_report_is_not_written_into_a_folder_with_other_files(tmp_path, capsys):
    from reports.__main__ import main as report

    mine = tmp_path / "scenes" / "four_bar.toml"
    mine.parent.mkdir()
    mine.write_text("# my own")
    assert report(["four_bar", "--out", str(tmp_path)]) == 2
    assert mine.read_text() == "# my own"
    assert "--force" in capsys.readouterr().err and [*tmp_path.iterdir()] == [mine.parent]


@pytest.mark.parametrize("path", ["no/such/folder/out.svg", "", ".", "x" * 300 + ".svg", "a\nb/c.svg"])
def test_path_that_cannot_be_written_is_refused_and_nothing_is_written(path, tmp_path, monkeypatch, capsys):
    """A missing folder, no name, a folder, a name of more than 255 bytes, a line break: --out is named."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["draw", "four_bar", "--out", path])
    assert ended.value.code == 2 and "--out" in capsys.readouterr().err
    assert not [*Path().iterdir()]


@pytest.mark.parametrize("place", ["mine.txt", "mine.txt/report"])
def test_report_into_a_file_is_refused_before_it_runs_and_the_file_stays(place, tmp_path, capsys):
    """--out names a file, or a folder inside of a file: a sentence says so."""
    (tmp_path / "mine.txt").write_text("my own")
    with pytest.raises(SystemExit) as ended:
        crosscheck(["report", "four_bar", "--out", str(tmp_path / place)])
    assert ended.value.code == 2
    assert f"{tmp_path / 'mine.txt'} is a file; name a folder" in capsys.readouterr().err
    assert [path.read_text() for path in tmp_path.iterdir()] == ["my own"]
