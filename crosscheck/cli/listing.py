"""The tables of `crosscheck list`: scenes, engines, methods, settings, metrics and support."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rich.console import Console
from rich.table import Table

import mbref
from crosscheck.cli import support
from crosscheck.cli.request import missing_package
from crosscheck.engine import default_engines, engine, engine_names
from mbref.scene import Scene
from mbref.scenes import SCENES


def show(console: Console, what: str | None) -> None:
    """Print one of TABLES, or all of them."""
    for name in [what] if what else TABLES:
        console.print(TABLES[name]())


def show_versions(console: Console) -> None:
    """Print the version of crosscheck and of each engine, one line each."""
    console.print(f"crosscheck {mbref.__version__}")
    for name in engine_names():
        console.print(f"{name} {missing_package(name) or engine(name).version()}")


def _scenes() -> Table:
    table = Table("scene", "bodies", "joints", "drivers, loads", "end (s)", title="scenes")
    for name, make in SCENES.items():
        scene = make()
        joints = ", ".join(f"{joint.name} {joint.type}" for joint in scene.joint)
        table.add_row(
            name, ", ".join(body.name for body in scene.body), joints, _causes(scene), f"{scene.duration:g}"
        )
    return table


def _causes(scene: Scene) -> str:
    gravity = ["gravity"] if any(scene.gravity) else []
    drivers = [f"driver of {driver.joint}" for driver in scene.driver]
    return ", ".join(gravity + drivers + [load.type for load in scene.load])


def _engines() -> Table:
    table = Table("engine", "package", "version", title="engines")
    for name in engine_names():
        found = engine(name)
        table.add_row(name, found.package, missing_package(name) or found.version())
    return table


def _methods() -> Table:
    grammar = "formulation+stabilisation/integrator, such as lm2+baumgarte[alpha=10,beta=10]/rk4"
    title = f"methods: {grammar}\n(meanings: mbref list methods)"
    table = Table("engine", "part", "name", "options", title=title)
    for name in engine_names():
        for part, entries in engine(name).family_parts().items():
            for entry, options in entries.items():
                table.add_row(name, part, entry, ", ".join(f"{k}={v:g}" for k, v in options.items()))
            table.add_section()
    return table


def _settings() -> Table:
    title = "settings: a family is a way to run an engine; its options control the accuracy"
    table = Table("engine", "name", "meaning", title=title)
    for name in engine_names():
        found = engine(name)
        whose = {f: "; integrated by crosscheck" for f in found.integrated_here}
        for entry, meaning in [
            *((f, text + whose.get(f, "")) for f, text in found.families.items()),
            *((f"option {o}", m) for o, m in found.options.items()),
        ]:
            table.add_row(name, entry, meaning)
        table.add_section()
    return table


def _metrics() -> Table:
    from crosscheck.judge.metrics import METRICS

    table = Table("metric", "unit", "definition", title="metrics")
    for name, metric in METRICS.items():
        table.add_row(name, metric.unit, metric.label)
    return table


def _support() -> Table:
    engines = default_engines()
    found = support.of_features(engines) | support.of_scenes(engines)
    notes = found.notes()
    table = Table("feature or scene", *engines, title="support: ✓ can, – cannot", caption_justify="left")
    for name in found.answers:
        table.add_row(name, *found.row(name, notes))
    table.caption = "\n".join(f"{i}. {note}" for i, note in enumerate(notes, 1))
    return table


TABLES: Mapping[str, Callable[[], Table]] = {
    "scenes": _scenes,
    "engines": _engines,
    "methods": _methods,
    "settings": _settings,
    "metrics": _metrics,
    "support": _support,
}
