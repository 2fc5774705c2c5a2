"""Optional engines whose packages are missing are named, listed, and not run by default."""

from importlib import metadata

import pytest

import crosscheck.engine as engine_module
from crosscheck.cli import request
from crosscheck.cli.request import RequestError, find_engines, missing_package
from crosscheck.engine import BUILT_IN, ON_REQUEST, OPTIONAL, default_engines, engine, engine_names, installed


@pytest.fixture
def nothing_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """An installation without the optional engines' packages."""
    version, absent = metadata.version, {engine(name).package for name in OPTIONAL + ON_REQUEST}

    def found(package: str) -> str:
        if package in absent:
            raise metadata.PackageNotFoundError(package)
        return version(package)

    monkeypatch.setattr(metadata, "version", found)


def test_optional_engines_without_their_packages_are_not_run_by_default(nothing_more: None) -> None:
    """Optional engines stay known by name. Unasked, the built-in ones run, and no notice names the others."""
    assert set(OPTIONAL) <= set(engine_names()), f"known: {engine_names()}"
    assert not any(map(installed, OPTIONAL)), f"installed: {[n for n in OPTIONAL if installed(n)]}"
    assert default_engines()[: len(BUILT_IN)] == BUILT_IN and not set(OPTIONAL) & set(default_engines())
    notices: list[str] = []
    assert not set(find_engines(None, notices.append)) & set(OPTIONAL)
    assert not any(name in notice for notice in notices for name in OPTIONAL), f"named unasked: {notices}"


@pytest.mark.parametrize("name", OPTIONAL + ON_REQUEST)
def test_request_for_a_missing_engine_names_the_package_to_install(nothing_more: None, name: str) -> None:
    """The reason, and the error of a command that names the engine, have the command of pip."""
    reason = missing_package(name)
    assert reason and f"pip install {engine(name).package}" in reason, reason
    with pytest.raises(RequestError, match=f"pip install {engine(name).package}"):
        find_engines([name], print)


@pytest.mark.parametrize("name", OPTIONAL + ON_REQUEST)
def test_installed_engines_run_by_default_except_those_on_request(name: str, monkeypatch) -> None:
    """Every package counts as installed. Engines on request compile code, or are large."""
    monkeypatch.setattr(metadata, "version", lambda package: "1.0")
    assert installed(name) and (name in default_engines()) == (name in OPTIONAL)


def test_engine_all_means_every_installed_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Installed are MuJoCo, Drake and CasADi. Engines named beside "all" come first, each once."""
    known = {"mujoco", "drake", "casadi"}
    monkeypatch.setattr(engine_module, "installed", lambda name: name in known)
    monkeypatch.setattr(request, "missing_package", lambda name: "")
    assert set(find_engines(["all"], print)) == known, find_engines(["all"], print)
    assert sorted(find_engines(["mujoco", "all"], print)) == sorted(known)
    assert find_engines(["mujoco", "all"], print)[0] == "mujoco"
