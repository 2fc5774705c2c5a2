"""Imports: packages, floors of their folders, no circle; judging apart from what is judged."""

import re

import pytest

from tests.meta.imports import ROOT, children, circle, floors, graph, imported, sources, upward

DOORS = (
    r"command_line|files|formats|printable|terminal|scene(\.(fields|joints|loads|toml|units|validation))?"
    r"|scenes(\.\w+)?|motions\.(crossing|event|trajectory)|rotations|records|__version__"
    r"|angles_at_start|assembled|counts"  # functions of scenes, whose results the judge checks
)
ALLOWED = {  # package → the names of mbref that it may import
    "crosscheck": re.compile(rf"mbref(\.({DOORS})(\.\w+)?)?"),
    "reports": re.compile(
        r"mbref(\.(command_line|counts|files|printable|scene|motions\.trajectory|rotations|records|motions\.drawing(\.\w+)?)(\.\w+)?)?"
    ),
}
ADAPTER = "crosscheck.engines.mbref"  # the one module that may import all of mbref

FLOORS = {  # lowest first; an arrow within a floor or downwards
    "mbref": (
        ["input_error", "files", "printable", "terminal", "rotations", "records"],
        ["scene", "kernels"],
        ["command_line", "scenes", "linear_algebra"],
        ["equations", "formulations", "integrators"],
        ["motions", "formats", "stabilisation"],
        ["method"],
        ["stepping"],
        ["taylor"],
        ["simulation"],
        ["ensembles", "design"],
        ["cli"],
        ["__main__"],
    ),
    "crosscheck": (
        ["judge"],
        ["recorded"],
        ["refusals", "setting"],
        ["engine", "linearising", "differentiating"],
        ["engines"],
        ["processes"],
        ["study"],
        ["conformance"],
        ["findings"],
        ["closed_loops"],
        ["convergence"],
        ["invariants", "alternatives"],
        ["small_motions", "derivatives"],
        ["paper"],
        ["versions"],
        ["files"],
        ["cli"],
        ["__main__"],
    ),
    "reports": (
        ["blocks", "markdown"],
        ["runs"],
        ["places", "engine_looks"],
        ["figures"],
        ["mechanisms", "speed_figure", "time_series"],
        ["sections"],
        ["render", "stored"],
        ["pages", "robot_files"],
        ["__main__", "keep"],
    ),
}

MAKING = {"study", "run", "run_case", "run_here", "run_isolated", "run_estimated", "time_interleaved"}
MAKING |= {"observe", "collection"}
MAKERS = (
    "crosscheck.processes",
    "crosscheck.engines",
    "crosscheck.cli.collection",
    "crosscheck.cli.moving_picture",
    "crosscheck.study.search.selection",
    "crosscheck.study.timings",
)


def of(package: str, module: str) -> set[str]:
    """Return the dotted names that a module imports."""
    return set(imported(sources(package)[module]))


def of_mbref(package: str, module: str) -> list[str]:
    return sorted(name for name in of(package, module) if name.split(".")[0] == "mbref")


def makes(name: str) -> bool:
    """Return whether an imported name runs an engine or makes a record."""
    return name.startswith(MAKERS) or name.rpartition(".")[2] in MAKING


@pytest.mark.parametrize("package", FLOORS)
def test_modules_do_not_import_each_other_in_a_circle(package):
    """In each package; imports inside functions and for types count, too."""
    assert not circle(graph(package))


@pytest.mark.parametrize("package", FLOORS)
def test_folders_do_not_import_each_other_in_a_circle(package):
    """In each folder the arrows between its modules and folders form no circle."""
    arrows = graph(package)
    folders = {module.rpartition(".")[0] for module in arrows if "." in module}
    assert not {folder: found for folder in folders if (found := circle(children(arrows, folder)))}


@pytest.mark.parametrize(("folder", "most"), [("mbref", 12), ("mbref.taylor", 9)])
def test_chains_of_imports_in_mbref_have_at_most_12_modules_and_in_taylor_9(folder, most):
    """A module or folder stands one floor above the highest of those beside it that it imports from."""
    arrows = children(graph("mbref"), folder)
    assert max(floors(arrows).values()) <= most, floors(arrows)


def test_root_of_mbref_has_at_most_12_files():
    """Other modules are in folders, by topic."""
    assert sum(path.is_file() for path in (ROOT / "mbref").iterdir()) <= 12


@pytest.mark.parametrize("package", FLOORS)
def test_module_does_not_import_from_a_higher_floor(package):
    """FLOORS has the folders and modules of each package, lowest first."""
    assert not upward(graph(package), FLOORS[package])


@pytest.mark.parametrize("package", ALLOWED)
def test_only_the_adapter_of_mbref_imports_its_numerical_modules(package):
    """ALLOWED are names of data, such as scenes and trajectories. The adapter needs others, so the rule finds
    it: a rule that allowed everything would not."""
    numerical = {
        module: names
        for module in sources(package)
        if (names := [n for n in of_mbref(package, module) if not ALLOWED[package].fullmatch(n)])
    }
    assert sorted(numerical) == [ADAPTER] * (package == "crosscheck"), numerical


def test_module_that_renders_reports_imports_nothing_that_makes_records():
    """Reports show records that crosscheck made before; MAKERS and MAKING name what makes them."""
    wrong = {
        module: names
        for module in sources("reports")
        if module != "reports.__main__" and (names := sorted(filter(makes, of("reports", module))))
    }
    assert not wrong, f"{wrong}: records are made before, by crosscheck"
    assert any(map(makes, of("reports", "reports.__main__"))), "the program makes records: the rule finds it"


def test_program_reports_imports_only_command_line_modules_of_crosscheck():
    """These modules of the command line call what runs engines, so that program reports need not."""
    names = {n for n in of("reports", "reports.__main__") if n.startswith("crosscheck.")}
    allowed = re.compile(r"crosscheck\.cli(\.(collection|options|scene_request|moving_picture)(\.\w+)?)?")
    wrong = sorted(n for n in names if not allowed.fullmatch(n))
    assert names and not wrong, wrong


def test_formulations_of_the_reference_share_no_equations_of_motion():
    """Common are equations of joints, for start velocities, functions of time, and arithmetic."""
    arrows = graph("crosscheck")
    natural, tree = (reached(arrows, f"crosscheck.judge.reference.{name}") for name in ("taylor", "tree"))
    shared = {name.removeprefix("crosscheck.judge.") for name in natural & tree}
    numbers = {"arithmetic", "time_functions", "reference.motion", "reference.start_velocities"}
    joints = {"constraints", "coupling_laws", "joint_coordinates", "joint_residuals", "driver_rows", "wheels"}
    without_equations = joints | {"deadline", "tolerances"}
    assert shared == numbers | without_equations, sorted(shared)


def reached(arrows: dict[str, set[str]], module: str) -> set[str]:
    """Return all modules that one imports, directly or through others."""
    found, waiting = set(), [module]
    while waiting:
        new = arrows.get(waiting.pop(), set()) - found
        found |= new
        waiting += new
    return found


@pytest.mark.parametrize("package", FLOORS)
def test_page_contributing_names_every_folder_in_its_list_of_floors(package):
    """The list is the paragraph that begins with "Folders have floors"."""
    text = (ROOT / "CONTRIBUTING.md").read_text().split("Folders have floors")[1].split("\n- ")[0]
    folders = {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}
    missing = {folder for folder in folders if not re.search(rf"\b{folder}\b", text)}
    assert not missing, f"CONTRIBUTING.md names no floor of {missing}"


def test_circles_floors_and_upward_imports_of_a_small_graph_are_found():
    """a.x imports b.y, b.y imports a.z, a.z imports a.x: a circle, and upward if a is the lower floor."""
    arrows = {"p": set(), "p.a.x": {"p.b.y"}, "p.b.y": {"p.a.z"}, "p.a.z": {"p.a.x"}, "p.c": {"p.a.x"}}
    assert circle(arrows) == ["p.a.x", "p.a.z", "p.b.y"] and circle({"a": {"b"}, "b": set()}) == []
    assert upward(arrows, [["a"], ["b"], ["c"]]) == ["p.a.x → p.b.y"]
    with pytest.raises(ValueError, match="on no floor: c"):
        upward(arrows, [["a"], ["b"]])
    assert children(arrows, "p") == {"a": {"b"}, "b": {"a"}, "c": {"a"}}
    assert floors({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == {"a": 3, "b": 2, "c": 1}


def test_imports_in_functions_and_for_types_are_arrows_except_for_types_of_a_package(tmp_path):
    """`import a` under TYPE_CHECKING is an arrow from a module. In an `__init__` it only tells type checkers
    the names that the package offers: no arrow. `import b.c` in a function is an arrow from both."""
    text = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import a\ndef f():\n    import b.c\n"
    for name, wanted in (
        ("module.py", {"typing", "typing.TYPE_CHECKING", "a", "b.c"}),
        ("__init__.py", {"typing", "typing.TYPE_CHECKING", "b.c"}),
    ):
        path = tmp_path / name
        path.write_text(text)
        assert set(imported(path)) == wanted
