"""Fixtures of tests of files."""

from pathlib import Path

import pytest

from mbref.cli import main
from mbref.scene import Scene


class Files:
    """Files in a folder of one test, imported by the command line."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture):
        self.folder, self.capsys, self.count = folder, capsys, 0

    @property
    def out(self) -> Path:
        """The scene file that the latest import wrote."""
        return self.folder / f"out{self.count}.toml"

    def run(self, text: str | bytes, name: str, *words: str) -> tuple[int, str, str]:
        """Return the exit status, the output and the errors of an import of a file with this text."""
        path = self.folder / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        self.capsys.readouterr()
        self.count += 1
        try:
            status = main(["import", str(path), "--out", str(self.out), *words])
        except SystemExit as end:
            status = int(end.code or 0)
        return status, *self.capsys.readouterr()

    def scene(self, text: str | bytes, name: str, *words: str) -> tuple[Scene, str]:
        """Return the scene that the command writes, and its output."""
        status, out, errors = self.run(text, name, *words)
        assert status == 0, errors
        return Scene.from_file(self.out), out

    def refusal(self, text: str | bytes, name: str, *words: str) -> str:
        """Return the sentences with which the command refuses a file, with exit status 2 and no scene."""
        status, _, errors = self.run(text, name, *words)
        assert status == 2, (status, errors)
        assert errors.strip() and "Traceback" not in errors and not self.out.exists()
        return errors


@pytest.fixture
def files(tmp_path, capsys) -> Files:
    """Return the command that imports files, in an empty folder."""
    return Files(tmp_path, capsys)
