"""An engine of bodies that fall freely, by a factor times the gravity; `wheels` makes versions of it."""

import numpy as np

from crosscheck.engine import Alternatives, Engine, Setting, Trajectory
from mbref.scene import Body, Scene

FACTOR, STEP = 1.0, 0.1
BODY = Body(name="stone", mass=2.0, inertia=(0.1, 0.1, 0.1), position=(0.0, 1.0, 2.0))
STONE = Scene(name="stone", gravity=(0.0, 0.0, -9.81), duration=0.2, body=(BODY,))


class Options:
    """Options with a default value."""

    step = STEP


def fall() -> None:
    """Do nothing: a name that the adapter uses."""


class Falling(Engine):
    """Falls by the option ``factor``; its default is a constant of the version."""

    name = "falling"
    package = "falling-engine"
    defaults_of = ("falling_engine.Options()",)

    def version(self):
        return "1.0"

    def settings(self, scene):
        return [Setting("plain", {"step": 1e-3})]

    def run(self, scene, times, setting):
        count, factor = (len(times), len(scene.body)), setting.options.get("factor", FACTOR)
        change = factor * np.tile(scene.gravity, (*count, 1))
        t, still = times[:, None, None], np.zeros((*count, 3))
        places = change * t**2 / 2 + [body.position for body in scene.body]
        turns, rates = np.tile([1.0, 0.0, 0.0, 0.0], (*count, 1)), (change * t, still, change, still)
        asked = (scene.name, self.name, self.version(), setting.family, dict(setting.options))
        return Trajectory(*asked, times, tuple(body.name for body in scene.body), places, turns, *rates)

    def uses(self):
        """Name a function of the library, which is not called."""
        import falling_engine

        return falling_engine.fall


class SeveralWays(Falling):
    """Two ways to fall, with one and with one and a half of the gravity."""

    alternatives = (
        Alternatives(
            {name: Setting("plain", {"factor": f}) for name, f in (("light", 1), ("heavy", 1.5))}, 1e-6
        ),
    )


ENGINE, SEVERAL = Falling(), SeveralWays()
