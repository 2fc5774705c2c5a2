"""Docstrings of public names: numpydoc sections for parameters, results, errors and attributes."""

import ast
import importlib
import importlib.util
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("mbref", "crosscheck")
PAGE = ROOT / "docs" / "api.md"
ARRAY = re.compile(r"ndarray")
SHAPE = re.compile(r"shape \(|\([a-z]\w*,|\d+, ")


def public() -> dict[str, Any]:
    """Classes and functions in ``__all__`` of both packages and on the page of the API, by path."""
    paths = [f"{name}.{entry}" for name in PACKAGES for entry in importlib.import_module(name).__all__]
    paths += re.findall(r"^::: (\S+)$", PAGE.read_text(), re.M)
    found = {}
    for path in paths:
        module, _, name = path.rpartition(".")
        thing = getattr(importlib.import_module(module), name)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            found.setdefault(f"{thing.__module__}.{thing.__qualname__}", thing)
    return found


def sections(docstring: str) -> dict[str, list[str]]:
    """Lines of each numpydoc section by its title; the text before the first section has the title ""."""
    lines, title = docstring.splitlines(), ""
    found: dict[str, list[str]] = {"": []}
    for k, line in enumerate(lines):
        if k + 1 < len(lines) and re.fullmatch(r"-{3,}", lines[k + 1]):
            title = line
            found[title] = []
        elif not re.fullmatch(r"-{3,}", line):
            found[title].append(line)
    return found


def entries(lines: list[str]) -> dict[str, str]:
    """Names of a section's entries, each with its type."""
    heads = [line.partition(" : ") for line in lines if line and not line.startswith(" ")]
    return {name.strip("* "): kind for names, _, kind in heads for name in names.split(",")}


def raised(function: Callable[..., Any]) -> set[str]:
    """Names of the exceptions that a function's own statements raise."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    calls = [node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise) and node.exc]
    names = [ast.unparse(call.func if isinstance(call, ast.Call) else call) for call in calls]
    return {name.rpartition(".")[2] for name in names}


def of_function(name: str, function: Callable[..., Any]) -> Iterator[str]:
    """Yield the faults of a function's docstring."""
    parts = sections(inspect.getdoc(function) or "")
    signature = inspect.signature(function)
    wanted = [p for p in signature.parameters if p not in ("self", "cls")]
    given = entries(parts.get("Parameters", []))
    yield from (f"{name}: parameter {p} is not described" for p in wanted if not given.get(p))
    yield from (f"{name}: no parameter {p}" for p in given if p not in wanted)
    result = str(signature.return_annotation)
    title = "Yields" if result.startswith(("Iterator", "Generator")) else "Returns"
    summary = " ".join(parts[""])
    is_described = summary.startswith("Return ") and "ndarray" not in result
    of_result = [line for line in parts.get(title, []) if line]
    if result != "None" and not of_result and not is_described:
        yield f"{name}: no section {title}"
    if is_described and len(of_result) == 1 and not SHAPE.search(of_result[0]):
        yield f"{name}: the section {title} repeats the signature"
    described = {error for entry in entries(parts.get("Raises", [])) for error in entry.split()}
    yield from (f"{name}: raises {error}" for error in sorted(raised(function) - described))
    yield from without_shape(name, [*parts.get("Parameters", []), *parts.get(title, [])])


def without_shape(name: str, lines: list[str]) -> Iterator[str]:
    """Yield the entries of arrays without a shape."""
    heads = [line for line in lines if ARRAY.search(line) and not line.startswith(" ")]
    yield from (f"{name}: no shape in {line!r}" for line in heads if not SHAPE.search(line))


def of_class(name: str, cls: type) -> Iterator[str]:
    """Yield the faults of the docstrings of a class, of its attributes and of its public methods."""
    parts = sections(inspect.getdoc(cls) or "")
    given = entries(parts.get("Attributes", []))
    own = [key for key in vars(cls).get("__annotations__", {}) if not key.startswith("_")]
    yield from (f"{name}: attribute {key} is not described" for key in own if not given.get(key))
    yield from without_shape(name, parts.get("Attributes", []))
    for key, member in vars(cls).items():
        if key.startswith(("_", "model_")):
            continue
        if isinstance(member, property | cached_property):
            getter = member.fget if isinstance(member, property) else member.func
            if not inspect.getdoc(getter):
                yield f"{name}.{key}: no docstring"
        elif inspect.isfunction(function := getattr(member, "__func__", member)):
            yield from of_function(f"{name}.{key}", inspect.unwrap(function))


def faults(name: str, thing: Any) -> list[str]:
    """Faults of the docstring of a class or function."""
    return list(of_class(name, thing) if inspect.isclass(thing) else of_function(name, thing))


def test_docstrings_of_public_names_describe_parameters_results_and_errors():
    """More than 45 classes and functions are public; ``faults`` has the rules of numpydoc."""
    found = public()
    assert len(found) > 45
    wrong = [fault for name, thing in found.items() for fault in faults(name, thing)]
    assert not wrong, "\n".join(wrong)


REPEATED = '''
def name_of(scene) -> str:
    """Return the name.

    Parameters
    ----------
    scene : Scene
        A scene.

    Returns
    -------
    str
    """
    return scene.name
'''
COMPLETE = '''
def scaled(values, factor: float) -> "np.ndarray":
    """Return values times a factor.

    Parameters
    ----------
    values : ndarray, shape (k,)
        Lengths, m.
    factor : float
        The factor.

    Returns
    -------
    ndarray, shape (k,)
        Lengths, m.

    Raises
    ------
    ValueError
        If the factor is zero.
    """
    if not factor:
        raise ValueError("zero")
    return values * factor
'''


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("    factor : float\n        The factor.\n", "", "parameter factor is not described"),
        ("    factor : float\n", "    width : float\n", "no parameter width"),
        ("    Returns\n    -------\n", "    Notes\n    -----\n", "no section Returns"),
        ("    ValueError\n", "    KeyError\n", "raises ValueError"),
        ("values : ndarray, shape (k,)", "values : ndarray", "no shape in"),
    ],
)
def test_fault_of_an_incomplete_docstring_is_named(tmp_path, old, new, fault):
    """In the complete docstring, which has no fault, ``old`` is replaced by ``new``."""
    assert faults("scaled", imported(tmp_path, COMPLETE).scaled) == []
    module = imported(tmp_path, COMPLETE.replace(old, new, 1))
    found = faults("scaled", module.scaled)
    assert any(fault in text for text in found), found


def test_section_that_repeats_the_signature_is_found(tmp_path):
    """A section Returns with the type alone says nothing new; a described section, or none, is right."""
    described = REPEATED.replace("    str\n", "    str\n        In lower case.\n")
    without = REPEATED.replace("    Returns\n    -------\n    str\n", "")
    texts = REPEATED, described, without
    found = [faults("name_of", imported(tmp_path, text).name_of) for text in texts]
    assert found == [["name_of: the section Returns repeats the signature"], [], []]


def imported(folder, text):
    """Return the module of a text, imported from a new file."""
    path = folder / f"module_{sum(1 for _ in folder.glob('*.py'))}.py"
    path.write_text(text)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
