"""Observed numbers of published problems / the printed start, and angles and rates that each count once."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from crosscheck.judge import published

NAMES = "OFBGA5H7"


def squeezer(monkeypatch, turns: dict[str, float], rates: list[float]) -> dict[str, float]:
    """The observed numbers of hinges that have turned by angles (rad), and bodies K1 to K7 that spin."""
    asked = []

    def coordinates(scene, times, position, orientation, spin):
        asked.append((times, position, orientation, spin))
        return {name: np.array([[9.0, 9.0], [turn, 8.0]]) for name, turn in turns.items()}

    monkeypatch.setattr(published.constraints, "joint_coordinates", coordinates)
    scene = SimpleNamespace(body=[SimpleNamespace(name=f"K{k}") for k in range(1, 8)])
    spin = np.zeros((2, 7, 3))
    spin[0], spin[1] = 77.0, 88.0
    spin[1, :, 2] = rates
    motion = SimpleNamespace(times=np.arange(2), position=1, orientation=2, angular_velocity=spin)
    found = published._squeezer(scene, motion)
    assert asked[0][0] is motion.times and (asked[0][3] == spin).all()
    return found


HINGES = ("O", "F", "B", "G", "A5", "H", "A7")


def test_angles_of_the_squeezer_at_its_printed_start(monkeypatch):
    """The test set prints β, Θ, γ, Φ, δ, Ω and ε to 16 digits and more; all rates are zero."""
    found = squeezer(monkeypatch, dict.fromkeys(HINGES, 0.0), [0.0] * 7)
    assert list(found)[:7] == ["beta", "Theta", "gamma", "Phi", "delta", "Omega", "epsilon"]
    assert list(found.values())[:7] == pytest.approx(
        [
            -0.06171389001427,
            0.0,
            0.45527981916307,
            0.22266839016588,
            0.48736497954384,
            -0.22266839016588,
            1.23054744454982,
        ],
        abs=1e-13,
    )
    assert set(list(found.values())[7:]) == {0.0}
    assert tuple(published.ANGLES) == tuple(list(found)[:7])


def test_each_hinge_and_each_body_of_the_squeezer_counts(monkeypatch):
    """The hinges have turned by 1, 2, 4, … rad; the bodies K1 to K7 spin at 1, 3, 9, 27, … rad/s."""
    still = squeezer(monkeypatch, dict.fromkeys(HINGES, 0.0), [0.0] * 7)
    turns = {name: 2.0**k for k, name in enumerate(HINGES)}
    found = squeezer(monkeypatch, turns, [3.0**k for k in range(7)])
    moved = [found[name] - still[name] for name in published.ANGLES]
    assert moved == pytest.approx([1, 2, 4, 8, 16, 32, 64])
    rates = [found[f"{name}'"] for name in published.ANGLES]
    assert rates == [1.0, 3.0 - 1.0, 9.0, 27.0 - 81.0, 81.0, 243.0 - 729.0, 729.0]


def motion(**parts) -> SimpleNamespace:
    places = np.array([[[9.0] * 3] * 2, [[1.0, -2.0, 3.0], [4.0, 5.0, -6.0]]])
    return SimpleNamespace(position=places, velocity=10 * places, **parts)


def test_the_top_of_an_upright_and_a_slider():
    """The last sample counts: twice the first body's centre; and the slider's height."""
    assert published._top_of_first_upright(None, motion()) == {"x": 2.0, "y": -4.0, "x'": 20.0, "y'": -40.0}
    scene = SimpleNamespace(body_index={"slider": 1}.__getitem__)
    assert (
        published._slider(scene, motion()) == {"s": -6.0, "s'": -60.0}
        and published._nothing(None, None) == {}
    )
    assert published._first_top(motion()).tolist() == [[18.0, 18.0, 180.0, 180.0], [2.0, -4.0, 20.0, -40.0]]
