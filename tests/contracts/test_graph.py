"""Spanning trees of random scenes keep mobility, inertia and velocities, and cut loops at fitting joints."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from crosscheck.engines.shared.spanning_tree import GROUND_LINK, Link, Tree, effective_mass, spanning_tree
from mbref import rotations
from mbref.scene import HOLONOMIC_JOINTS, Body, Distance, Driver, Scene
from tests.helpers.parts import X, block, hinge, joint
from tests.helpers.tree_scenes import INERTIA, body, every_joint, ring

KINDS = tuple(HOLONOMIC_JOINTS.values())
ROUNDING = 1e-12  # of the largest value, after sums of up to 15 links
CLOSURE_ROWS = {"point": 3, "weld": 6}


@st.composite
def graphs(draw: st.DrawFn) -> Scene:
    """Draw scenes of 1 to 6 bodies and up to 9 joints of any kind, between any two of them or the ground."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1), label="seed"))
    n = draw(st.integers(1, 6), label="bodies")
    bodies = [body(f"b{i}", *rng.normal(size=(2, 3)), float(rng.uniform(0.5, 2))) for i in range(n)]
    names = ["ground", *(b.name for b in bodies)]
    joints = []
    for k, kind in enumerate(draw(st.lists(st.sampled_from(KINDS), max_size=9), label="joints")):
        pair = tuple(str(name) for name in rng.choice(names, 2, replace=False))
        u, v = rng.normal(size=(2, 3))
        joints.append(kind.at(f"j{k}", pair, axis=u, axes=(u, np.cross(u, v)), anchor=v, anchors=(u, v)))
    return Scene(name="graph", body=bodies, joint=tuple(joints))


def rods(tree: Tree) -> list:
    """Return the links that stand for distance joints."""
    return [link for link in tree.links if link.ends]


@given(graphs())
def test_links_of_a_tree_are_in_depth_first_order(scene: Scene) -> None:
    """The parent of each link is the ground or on the way from the ground to the link before."""
    way: list[int] = []
    for k, link in enumerate(spanning_tree(scene).links):
        while way and way[-1] != link.parent:
            way.pop()
        assert link.parent in (GROUND_LINK, *way), f"link {k} hangs from {link.parent}, not on the way {way}"
        way.append(k)


@given(graphs())
def test_tree_with_its_closures_has_the_mobility_of_the_scene(scene: Scene) -> None:
    """The scene has 6 velocities per body less the rows of its joints, redundant or not. The tree has as many
    joint velocities less rows of closures, apart from the spin of each rod about its axis."""
    tree = spanning_tree(scene)
    counted = 6 * len(scene.body) - sum(each.facts.rows for each in scene.joint)
    spins = len(rods(tree))
    assert tree.nv - spins - sum(CLOSURE_ROWS[c.kind] for c in tree.closures) == counted


@given(graphs())
def test_spatial_inertias_of_links_and_of_bodies_have_one_sum(scene: Scene) -> None:
    """The tree splits bodies into links. It takes the mass of a rod from the bodies at its ends, half from
    each; a half at the ground is taken from no body and is a surplus of the links. Mass, first and second
    moments about the origin have equal sums to 1e-12 of the largest: rounding of 15 links."""
    tree = spanning_tree(scene)
    links = sum(spatial_inertia(k.mass, k.position + k.offset, without_spin(k)) for k in tree.links)
    surplus = sum(
        (
            spatial_inertia(rod.mass / 2, point, np.zeros((3, 3)))
            for rod in rods(tree)
            for end, point in rod.ends
            if end == GROUND_LINK
        ),
        start=np.zeros((4, 4)),
    )
    turned = [rotations.to_matrix(np.array(b.orientation)) for b in scene.body]
    pairs = zip(scene.body, turned, strict=True)
    own = [(b.mass, np.array(b.position), r @ np.array(b.inertia) @ r.T) for b, r in pairs]
    bodies = sum(spatial_inertia(*numbers) for numbers in own)
    assert abs(links - surplus - bodies).max() < ROUNDING * abs(bodies).max()


def without_spin(link: Link) -> np.ndarray:
    """Return a link's inertia; for a rod, without its moment about its axis, about which it never spins."""
    if not link.ends:
        return link.inertia
    along = link.ends[1][1] - link.ends[0][1]
    along = along / np.linalg.norm(along)
    return link.inertia - (along @ link.inertia @ along) * np.outer(along, along)


def spatial_inertia(mass: float, centre: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Return mass, first and second moments about the world's origin (4, 4)."""
    second = np.trace(inertia) / 2 * np.eye(3) - inertia + mass * np.outer(centre, centre)
    return np.block([[second, mass * centre[:, None]], [mass * centre[None], np.array([[mass]])]])


@given(graphs())
def test_every_link_has_a_positive_mass_and_inertia(scene: Scene) -> None:
    """Engines refuse links without mass. The least principal moment of inertia is positive."""
    for link in spanning_tree(scene).links:
        least = np.linalg.eigvalsh(link.inertia)[0]
        assert link.mass > 0 and least > 0


@given(graphs(), st.data())
def test_a_driven_joint_is_never_cut_and_has_one_coordinate(scene: Scene, data: st.DataObject) -> None:
    """The driver is of any joint that may have one; ``nv`` is the number of coordinates."""
    names = [each.name for each in scene.joint if each.facts.driven]
    assume(names)
    name = data.draw(st.sampled_from(names))
    scene = scene.with_(driver=(Driver(joint=name, polynomial=(0.0, 1.0)),))
    tree = spanning_tree(scene)
    assert name not in [scene.joint[cut.joint].name for cut in tree.closures]
    assert 0 <= tree.coordinate(scene, name) < tree.nv


@pytest.mark.parametrize("kind", ["revolute", "cylindrical", "universal", "spherical", "planar"])
def test_a_loop_is_cut_at_its_joint_with_most_freedoms(kind: str) -> None:
    """In a ring of hinges a joint of the kind is cut: a spherical one is replaced by a point of two links;
    any other carries half of a body, which a weld holds to its other half."""
    (closure,) = spanning_tree(ring(kind)).closures
    expected = "point" if kind == "spherical" else "weld"
    cut = ring(kind).joint[closure.joint]
    assert closure.kind == expected, f"{kind}: closed by a {closure.kind}, not a {expected}"
    assert cut.type == kind, f"cut the {cut.type} {cut.name}, not the {kind}"


@pytest.mark.parametrize(("kind", "axis"), [("fixed", {}), ("translational", {"axis": X})])
def test_a_body_is_split_in_halves_to_cut_a_loop_of_equal_joints(kind: str, axis: dict) -> None:
    """Two bodies of 2 kg, a and b, and three joints are a loop. Body b becomes two links of 1 kg."""
    pairs = (("ground", "a"), ("a", "b"), ("b", "ground"))
    bodies = [block(name, (0.0, 0.0, 0.0), 2.0) for name in "ab"]
    joints = [joint(f"j{i}", kind, *pair, **axis) for i, pair in enumerate(pairs)]
    scene = Scene(name="stiff", body=bodies, joint=joints)
    tree = spanning_tree(scene)
    assert [link.mass for link in tree.links if link.body == 1] == [1.0, 1.0]


def test_a_rod_takes_less_than_half_of_the_effective_mass_at_its_ends() -> None:
    """A distance joint becomes a rod, whose mass is taken from the bodies at its ends, half from each. That
    is less than half of the effective mass there, which is the mass that a force at the point feels."""
    scene = every_joint()
    tree = spanning_tree(scene)
    (rod,) = rods(tree)
    whole = spanning_tree(scene.with_(joint=tuple(j for j in scene.joint if not isinstance(j, Distance))))
    spare = min(effective_mass(whole.links[whole.own[b]], point) for b, point in rod.ends)
    assert 0 < rod.mass / 2 < 0.5 * spare, (rod.mass, spare)


@given(graphs(), st.sampled_from([(), ("spherical", "revolute")]))
def test_loops_are_cut_between_links_and_not_at_the_ground_on_request(scene, closes):
    """With ``between_links`` no cut is at the ground, and there are as many cuts as without it."""
    cuts = spanning_tree(scene, closes).closures
    assume(cuts)
    between = spanning_tree(scene, closes, between_links=True).closures
    assert len(between) == len(cuts) and all(GROUND_LINK not in cut.links for cut in between)


def hinged(*pairs: tuple[str, str]) -> Scene:
    """Return bodies at x = 0, 1, 2, … in the order of their names, with parallel hinges between pairs."""
    names = sorted({name for pair in pairs for name in pair} - {"ground"})
    parts = {"mass": 1.0, "inertia": INERTIA}
    bodies = [Body(name=n, position=(float(k), 1.0, 0.0), **parts) for k, n in enumerate(names)]
    joints = [hinge(f"j{k}", *pair, (float(k), 0.0, 0.0)) for k, pair in enumerate(pairs)]
    return Scene(name="hinged", body=bodies, joint=joints)


def test_a_body_with_two_hinges_to_the_ground_is_split_if_the_ground_is_never_cut():
    """Hinges 0 and 1 join body a to the ground: a loop that is nowhere between links. Its cut is a weld of
    two halves of a, 0.5 kg each. The other loops are cut at hinges 2 and 4, between a and b."""
    two_loops = hinged(("ground", "a"), ("a", "ground"), ("a", "b"), ("b", "ground"), ("b", "a"))
    found = spanning_tree(two_loops, ("revolute",), between_links=True)
    assert [(c.kind, c.joint) for c in found.closures] == [("weld", 1), ("revolute", 2), ("revolute", 4)]
    assert sorted(link.mass for link in found.links) == [0.5, 0.5, 1.0]
