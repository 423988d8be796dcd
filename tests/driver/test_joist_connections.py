"""Screws and blocking of joist floors: limits, the composite action, and what contradicts it."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import thud
from thud.base.bridge import ask
from thud.case.case import case_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

JOISTS = thud.JoistFloor(length=3.0, width=2.5)
FREQUENCY = np.array([31.5, 63.0, 125.0, 250.0, 500.0])


def frequencies_of(floor: thud.FloorOptions, highest: float = 200.0) -> Array:
    """Return natural frequencies, Hz."""
    case = thud.Case(floor=floor)
    return np.asarray(ask("floor_modes", case=case_text(case), highest=highest)["frequency"])


def test_slip_of_screws_is_the_composite_action_of_the_standard() -> None:
    """EN 1995-1-1 (B.5): gamma = 1/(1 + pi**2 E A s/(K l**2))."""
    slip, spacing = 2.3e6, 0.2
    gamma = 1 / (1 + np.pi**2 * 3e9 * 0.022 * 0.4 * spacing / (slip * 3.0**2))
    assert 0.2 < gamma < 0.4
    screwed = thud.mobility(replace(JOISTS, screw_slip=slip, screw_spacing=spacing), FREQUENCY)
    stated = thud.mobility(replace(JOISTS, connection=gamma), FREQUENCY)
    assert screwed == pytest.approx(stated, rel=1e-9)
    glued = thud.mobility(replace(JOISTS, connection=1.0), FREQUENCY)
    stiff = thud.mobility(replace(JOISTS, screw_slip=1e12), FREQUENCY)
    assert stiff == pytest.approx(glued, rel=1e-4)
    assert abs(screwed / glued - 1).max() > 0.05


def test_stiff_screws_hold_the_sheathing_on_the_joists(oracle: Callable[..., None]) -> None:
    rigid = frequencies_of(JOISTS)
    stiff = frequencies_of(replace(JOISTS, screw_stiffness=1e11))
    oracle("natural frequencies: stiff screws − rigid ones", "other model", stiff / rigid - 1, 1e-5)
    loose = frequencies_of(replace(JOISTS, screw_stiffness=3e5))
    assert len(loose) > len(rigid)
    assert (loose[: len(rigid)] <= rigid * (1 + 1e-9)).all()
    wide = frequencies_of(replace(JOISTS, screw_stiffness=6e5, screw_spacing=0.3))
    assert wide == pytest.approx(loose, rel=1e-9)


def test_screws_open_the_way_between_joist_and_subceiling() -> None:
    """The channels hang on the joists, not on the sheathing."""
    hung = replace(
        JOISTS, subceiling_thickness=0.0125, cavity_depth=0.25, channel_stiffness=1e9,
        source_on="sheathing",
    )  # fmt: skip
    case = thud.Case(floor=hung, room=thud.Room())
    loose = replace(case, floor=replace(hung, screw_stiffness=3e5))
    rigid, found = (
        ask("radiation", case=case_text(c), x=np.array([0.4]), y=np.array([0.34]))["radiated"]
        for c in (case, loose)
    )
    assert (10 * np.log10(found / rigid)[-3:] < -1).all()
    stiff = replace(case, floor=replace(hung, screw_stiffness=1e11))
    same = ask("radiation", case=case_text(stiff), x=np.array([0.4]), y=np.array([0.34]))
    assert 10 * np.log10(same["radiated"] / rigid) == pytest.approx(0, abs=0.05)


def test_stiff_blocking_is_a_line_that_does_not_move(oracle: Callable[..., None]) -> None:
    """Held by both edges, a rigid row across all joists rests as on a wall."""
    blocked = frequencies_of(replace(JOISTS, blocking_x=(1.2,), blocking_stiffness=1e11))
    supported = frequencies_of(replace(JOISTS, line_x=(1.2,)))
    oracle(
        "10 natural frequencies: rigid blocking − a line support",
        "other model",
        blocked[:10] / supported[:10] - 1,
        1e-2,
    )
    free = frequencies_of(JOISTS)
    assert free[0] < 0.7 * blocked[0]
    # The mode with a node at the row feels its mass and its moment of inertia only.
    center = frequencies_of(replace(JOISTS, blocking_x=(1.5,), blocking_stiffness=1.0))
    assert (center[:5] < free[:5]).all()


def test_blocking_has_the_section_of_a_joist_unless_its_stiffness_is_stated() -> None:
    default = frequencies_of(replace(JOISTS, blocking_x=(1.0, 2.0)))
    section = 1.1e10 * 0.06 * 0.22**3 / 12
    stated = replace(JOISTS, blocking_x=(1.0, 2.0), blocking_stiffness=section)
    assert default == pytest.approx(frequencies_of(stated), rel=1e-9)
    # Modes across the joists become stiffer: fewer below a frequency.
    assert len(default) < len(frequencies_of(JOISTS))


@pytest.mark.parametrize("keys", [{"screw_stiffness": 3e6}, {"blocking_x": (1.5,)}])
def test_screwed_and_blocked_floors_are_passive_and_radiate_in_all_bands(
    keys: dict[str, Any], shell: thud.Impact
) -> None:
    floor = replace(JOISTS, **keys)
    assert (thud.mobility(floor, np.geomspace(1.0, 5000.0, 2000)).real >= 0).all()
    room = thud.Room(reverberation_time=(0.1,))
    found, plain = (thud.predict_level(shell, kind, room).level for kind in (floor, JOISTS))
    change = found - plain
    assert 0.1 < abs(change).max() < 15
    assert abs(change[-3:]).max() < 6


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"connection": 0.5, "screw_slip": 2e6}, "connection and screw_slip state"),
        ({"blocking_x": (1.0, 3.0)}, "blocking_x = 3.0 m lies outside the floor; allowed: below 3"),
        ({"screw_spacing": 0.0}, "screw_spacing"),
    ],
)
def test_connections_that_cannot_be_are_refused(keys: dict[str, Any], words: str) -> None:
    with pytest.raises(thud.InputError, match=re.escape(words)) as refused:
        thud.mobility(replace(JOISTS, **keys), [50.0])
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("keys", [{}, {"subceiling_thickness": 0.0125, "cavity_depth": 0.247}])
def test_level_below_joists_hardly_depends_on_the_width_of_the_floor(
    keys: dict[str, float],
) -> None:
    """Modes of wide floors end below the bands; their middle represents them there."""
    impact = thud.solve(model="modal_ball")
    room = thud.Room(length=6.0, width=5.0, height=2.5)
    narrow, wide = (
        thud.predict_level(impact, thud.JoistFloor(length=6.0, width=width, **keys), room).level
        for width in (5.0, 20.0)
    )
    # Parts of the energy are beyond the room.
    assert np.max(abs(wide - narrow)[5:]) < 4.0
