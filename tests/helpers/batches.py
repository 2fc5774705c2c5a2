"""Pairs of scenes whose numbers decide which rows are independent, and all numbers of a run."""

from mbref.motions.motion import Motion
from mbref.scene import Body, Force, Revolute, Scene, Spring, Translational
from mbref.scenes import SCENES

CRANK, SPATIAL = SCENES["planar_slider_crank"](), SCENES["spatial_slider_crank"]()
X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def results(run: Motion) -> list:
    """Return outcome, message, end time, counts and the bytes of all arrays of a run."""
    arrays = [getattr(run, key) for key in ("position", "orientation", "velocity", "angular_velocity")]
    arrays += [run.acceleration, run.angular_acceleration]
    for table in (run.reactions, run.open_reactions):
        arrays += [table[name] for name in sorted(table)]
    cost = [run.cost.steps, run.cost.rhs, run.cost.factorisations, run.cost.newton]
    return [run.outcome.name, run.message, run.t_end, cost, *(array.tobytes() for array in arrays)]


def crank_with(force: tuple[float, float, float], **changes) -> Scene:
    """The planar slider-crank with a force on its rod; a force across the plane bends it out of the plane."""
    place = CRANK.body[1].position
    further = Force(body=CRANK.body[1].name, point=place, force=force)
    return CRANK.with_(load=(*CRANK.load, further), **changes)


def rail(across: float, inertia: float = 0.02) -> Scene:
    """A slide on an arm, pulled by a spring to a point at the height ``across`` (m) over their plane and by a
    force of as many N across it: both tend to turn arm and slide out of the plane."""
    middle, above = (0.3, 0.0, 0.0), (0.3, 0.5, across)
    bodies = (
        Body(name="arm", mass=1.0, inertia=(0.01, 0.02, 0.02), position=(0.1, 0.0, 0.0)),
        Body(name="slide", mass=1.0, inertia=(inertia, inertia, inertia), position=middle),
    )
    pin = Revolute(name="pin", bodies=("ground", "arm"), anchor=(0.0, 0.0, 0.0), axis=Z)
    guide = Translational(name="guide", bodies=("arm", "slide"), anchor=middle, axis=X)
    pull = Spring(bodies=("ground", "slide"), points=(above, middle), stiffness=20.0, natural_length=0.3)
    push = Force(body="slide", point=middle, force=(0.0, 0.0, across))
    return Scene(name="rail", duration=0.5, body=bodies, joint=(pin, guide), load=(pull, push))


NUMBERS_DECIDE = {
    "a force out of the plane": [crank_with((0.0, 1.0, 0.0)), crank_with((0.0, 1.0, 0.5))],
    "gravity out of the plane": [CRANK.with_(gravity=(0.0, g, h)) for g, h in ((-9.8, 0.0), (-9.8, 1.0))],
    "motion at the start": [
        SPATIAL.with_(body=tuple(b.model_copy(update={"angular_velocity": None}) for b in SPATIAL.body)),
        SPATIAL.with_("body[crank].angular_velocity", (0.0, 3.0, 0.0)),
    ],
    "a spring out of the plane": [rail(0.0), rail(0.2)],
    "no moment of inertia": [rail(0.2), rail(0.2, inertia=0.0)],
}
