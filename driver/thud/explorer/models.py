"""What the page says of source models and floors: purpose, validity, first values, unused keys."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import f90nml

from thud.base._schema import FLOORS, MODELS
from thud.base.files import inputs_folder
from thud.case.keys import humanize

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from thud.base.key import Key
    from thud.case.case import Case

    Values = dict[str, dict[str, object]]

# Keys of a ball that is more than a mass.
_BALL = (
    "outer_radius", "wall_thickness", "youngs_modulus", "poisson_ratio", "gauge_pressure",
    "ambient_pressure", "heat_capacity_ratio",
)  # fmt: skip
# Parameters of a rubber ball that a maker can change.
_MADE = ("youngs_modulus", "wall_thickness", "outer_radius", "mass")


@dataclass(frozen=True)
class Facts:
    """What the page says of a source model or a floor.

    Attributes
    ----------
    title : str
        Title; by default the name in words.
    purpose, validity : str
        What it is for, and how far its results can be trusted: one line each.
    example : str
        Example input with whose values the page begins; empty: the defaults.
    unused, tuned, fitted : tuple of str
        Keys of all models without effect on this one; parameters of a source that may be changed so
        that it conforms; those that a recording determines.
    has_room : bool
        Whether a room below a floor can be predicted.
    """

    title: str = ""
    purpose: str = ""
    validity: str = ""
    example: str = ""
    unused: tuple[str, ...] = ()
    tuned: tuple[str, ...] = ()
    fitted: tuple[str, ...] = ()
    has_room: bool = True

    def data(self, name: str) -> dict[str, Any]:
        """Return the facts of a model or a floor with a name, for the page."""
        return {
            "name": name,
            "title": self.title or humanize(name).capitalize(),
            "purpose": self.purpose,
            "validity": self.validity,
            "values": _stated(self.example) if self.example else {},
            "has_room": self.has_room,
        }


def _stated(name: str) -> Values:
    """Return what an example input states of its source or floor; paths of files are absolute."""
    path = inputs_folder() / name
    values: Values = f90nml.read(path).todict()
    for keys in values.values():
        if "file" in keys:
            keys["file"] = str(path.parent / str(keys["file"]))
    return {
        group: keys for group, keys in values.items() if group not in {"model", "floor", "room"}
    }


MODEL_FACTS = {
    "modal_ball": Facts(
        "Standard ball",
        "Use it by default: the exact modes of a rubber sphere, computed while a slider moves",
        "Octaves from 31.5 to 500 Hz within 1.1 dB of nominal. The modes are linear: their modulus "
        "is an effective one.",
        tuned=("loss_factor", *_MADE),
        fitted=("youngs_modulus", "loss_factor"),
    ),
    "finite_element": Facts(
        "Standard ball, finite elements",
        "A check at large strain: a rubber ball in detail, with gas, losses and friction",
        "Octaves from 31.5 to 500 Hz within 1 dB of nominal; 500 Hz follows from the damping law.",
        unused=("gauge_pressure",),
        tuned=("loss_factor", *_MADE),
        fitted=("youngs_modulus", "loss_factor"),
    ),
    "hollow_sphere": Facts(
        "Thin shell",
        "The analytical model of the paper: contact time and peak force",
        "Octaves 31.5 and 63 Hz; from 125 Hz on 4 to 5 dB too low, as a shell without modes.",
        tuned=_MADE,
        fitted=("youngs_modulus",),
    ),
    "two_mass": Facts(
        "Tyre: belt and rim",
        "The tyre of the bang machine: a belt on its contact patch and a rim above it",
        "Carcass and damping are chosen so that the tyre conforms: it shows effects of parts.",
        "tyre.nml",
        _BALL,
        ("belt_mass", "belt_frequency", "carcass_stiffness", "contact_damping", "mass"),
        ("carcass_stiffness", "contact_damping"),
    ),
    "measured_modes": Facts(
        "Measured modes",
        "A ball whose natural frequencies on the floor were measured",
        "The force on a rigid floor, which a room below takes as it is; frequencies, damping and "
        "masses determine it.",
        "measured_modes.nml",
        (*_BALL, "substeps"),
    ),
    "hunt_crossley": Facts(
        "One mass on a spring",
        "The simplest source, by contact time and restitution (Hunt and Crossley)",
        "A baseline: contact time and restitution do not determine the levels.",
        "tyre_one_mass.nml",
        _BALL,
        ("contact_time", "restitution", "exponent", "mass"),
        ("contact_time", "restitution"),
    ),
}
FLOOR_FACTS = {
    "rigid": Facts(
        "Rigid test floor",
        "The floor on which the standards assess a source",
        "It does not move.",
        has_room=False,
    ),
    "plate": Facts(
        "Plate",
        "Concrete slabs, with floating floor, ceiling and covering",
        "Rectangular plates; the uncertainty of the level names what is not known.",
    ),
    "laminate_floor": Facts(
        "Cross-laminated timber",
        "Plates of crossed timber layers, with floating floor and ceiling",
        "Rectangular plates without shear of the joints between panels.",
    ),
    "joist_floor": Facts(
        "Timber joists",
        "Sheathing on joists, with floating floor and ceiling",
        "One row of equal joists along the length.",
    ),
    "infinite_plate": Facts(
        "Infinite plate",
        "The mean of a floor: a resistance without reflections",
        "Force only: no level in a room below.",
        has_room=False,
    ),
    "oscillator": Facts(
        "Oscillator",
        "A floor with one resonance, such as a mock-up",
        "Force only: no level in a room below.",
        has_room=False,
    ),
    "measured_mobility": Facts(
        "Measured mobility",
        "A floor whose mobility under the source was measured and fitted",
        "Frequencies of the measurement only.",
        "floors/measured_slab.nml",
    ),
    "modal_floor": Facts(
        "Modes of a file",
        "A floor whose modes another program has computed",
        "Frequencies of the modes in the file only.",
        "floors/modal_slab.nml",
    ),
}

# Keys that are shown at first, by owner or group; the others are folded. Owners and groups that are
# not listed show all keys.
SHOWN = {
    "ball": ("outer_radius", "wall_thickness", "mass", "youngs_modulus"),
    "drop": ("height",),
    "limits": ("source",),
    "sampling": (),
    "levels": (),
    "hollow_sphere": (),
    "modal_ball": ("damping_law", "loss_factor"),
    "finite_element": ("viscosity", "loss_factor", "fractional_order"),
    "two_mass": ("belt_mass", "inflation_pressure", "belt_frequency", "contact_damping"),
    "measured_modes": ("frequency", "damping_ratio", "effective_mass"),
    "hunt_crossley": ("contact_time", "restitution", "exponent"),
    "plate": (
        "length", "width", "thickness", "density", "loss_factor", "support", "screed_thickness",
        "layer_stiffness", "subceiling_thickness", "covering_improvement",
    ),
    "laminate_floor": (
        "length", "width", "layer_thickness", "loss_factor", "support", "screed_thickness",
        "layer_stiffness", "subceiling_thickness", "added_mass",
    ),
    "joist_floor": (
        "length", "width", "spacing", "joist_width", "joist_height", "sheathing_thickness",
        "loss_factor", "support", "screed_thickness", "layer_stiffness", "subceiling_thickness",
    ),
    "measured_mobility": ("pole_frequency", "damping_ratio", "length", "width", "thickness"),
    "modal_floor": ("file", "thickness"),
    "room": (
        "length", "width", "height", "reverberation_time", "ceiling_mass", "required", "rating",
    ),
}  # fmt: skip


def facts_of(case: Case) -> Facts:
    """Return the facts of the source model of a case."""
    return MODEL_FACTS.get(case.model.name if case.model else "", Facts())


def model_facts() -> list[dict[str, Any]]:
    """Return the facts of all source models for the page, the most useful model first."""
    return _facts(MODEL_FACTS, MODELS)


def floor_facts() -> list[dict[str, Any]]:
    """Return the facts of all floors for the page."""
    return _facts(FLOOR_FACTS, FLOORS)


def _facts(stated: Mapping[str, Facts], known: Iterable[str]) -> list[dict[str, Any]]:
    return [stated.get(name, Facts()).data(name) for name in dict.fromkeys((*stated, *known))]


def users_of(key: Key) -> list[str] | None:
    """Return the models that use a key that all models have; None: all of them."""
    unused = {name for name, facts in MODEL_FACTS.items() if key.name in facts.unused}
    return [name for name in MODELS if name not in unused] if unused and not key.owner else None


def is_folded(key: Key) -> bool:
    """Return whether most users never change a key."""
    shown = SHOWN.get(key.owner or key.group)
    return shown is not None and key.name not in shown
