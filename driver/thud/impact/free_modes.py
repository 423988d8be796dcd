"""Free modes of the ball (paper, figure 4)."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from thud.base._schema import Ball, FiniteElement, Modes
from thud.base.bridge import ask, notes, without_units
from thud.base.checks import require_kind
from thud.base.display import Tabulated
from thud.base.errors import PlausibilityWarning
from thud.case.case import Case, case_text
from thud.impact.motion import write_vtu
from thud.level.levels import finite_array
from thud.level.rating import POSITIVE

if TYPE_CHECKING:
    import os

    from numpy.typing import ArrayLike, NDArray

    from thud.base.bridge import Bundle
    from thud.base.display import Columns
    from thud.base.note import Note


@dataclass(frozen=True, eq=False)
class FreeModes(Tabulated):
    """Axisymmetric elastic modes without twist, by ascending frequency.

    Nodes are ordered from the lowest point to the highest and from the inner surface to the outer
    surface. The components of vectors are the distance from the axis and the height.

    Attributes
    ----------
    ball : Ball
        The ball.
    frequency : ndarray, shape (n_mode,)
        Natural frequencies of the elastic modes, Hz.
    harmonic : ndarray, shape (n_mode,)
        Order of the Legendre polynomial.
    participation : ndarray, shape (n_mode,)
        Mass of the ball times the squared amplitude of the lowest point at unit modal mass, which
        states how strongly a force there excites the mode; 1 for the rigid motion.
    start : ndarray, shape (n_line, n_ring, 2)
        Positions of the nodes relative to the center of the ball, m.
    shape : ndarray, shape (n_mode, n_line, n_ring, 2)
        Displacements of the nodes; the maximum length is 1, and the lowest point moves upwards.
    notes : tuple of Note
        Warnings on implausible input.
    """

    drawn_by: ClassVar[str] = "ball_figures.mode_shapes"

    ball: Ball
    frequency: NDArray[np.float64]
    harmonic: NDArray[np.int32]
    participation: NDArray[np.float64]
    start: NDArray[np.float64]
    shape: NDArray[np.float64]
    notes: tuple[Note, ...] = ()

    def __repr__(self) -> str:
        """Return the frequencies, without the shapes."""
        return f"<FreeModes: {', '.join(f'{f:.2f}' for f in self.frequency)} Hz>"

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the shapes for ParaView to a VTU file; an existing one is replaced.

        Raise InputError if the path does not end with ``.vtu`` or meshio is not installed, and
        OSError if the file cannot be written.
        """
        names = (f"mode {i}, {f:.3f} Hz" for i, f in enumerate(self.frequency, 1))
        write_vtu(path, self.start, dict(zip(names, self.shape, strict=True)))

    def columns(self) -> Columns:
        """Return frequencies, harmonics and participations."""
        return {
            "frequency, Hz": (self.frequency, ".2f"),
            "harmonic": (self.harmonic, "d"),
            "participation": (self.participation, ".3f"),
        }


def free_modes(ball: Ball | None = None, count: int = Modes.count) -> FreeModes:
    """Compute the lowest free modes of a ball: those of the hollow sphere, to ten digits.

    Parameters
    ----------
    ball
        Ball, by default the standard ball. Poisson's ratio may be 1/2.
    count
        Number of elastic modes.

    Returns
    -------
    FreeModes
        Frequencies, harmonics, participations and shapes.

    Raises
    ------
    InputError
        If the input is invalid; the message names group, key, value and allowed range.
    NumericalError
        If the modes cannot be computed.

    Warns
    -----
    PlausibilityWarning
        For each entry of `FreeModes.notes`.
    """
    case = Case(ball=Ball() if ball is None else ball, model=None, modes=Modes(count))
    modes = new_modes(case.ball, ask("solve", case=case_text(case)))
    for note in modes.notes:
        warnings.warn(PlausibilityWarning(note), stacklevel=3)
    return modes


def new_modes(ball: Ball, answer: Bundle) -> FreeModes:
    """Return the free modes in a bundle of the library."""
    modes, shapes = without_units(answer["modes"]), answer["mode_shapes"]
    return FreeModes(
        ball,
        modes["frequency"],
        modes["harmonic"].astype(np.int32),
        modes["pole_participation"],
        np.stack((shapes["r"], shapes["z"]), axis=-1),
        np.moveaxis(shapes["shape"], (-1, 0), (0, -1)),
        notes(answer.get("warnings", {})),
    )


def loss_factors(model: FiniteElement, frequency: ArrayLike) -> NDArray[np.float64]:
    """Return the loss factor of the material of a finite-element model in shear.

    Parameters
    ----------
    model
        The model; its options of the group ``&material`` are used.
    frequency : array_like, shape (n,)
        Frequencies, Hz.

    Returns
    -------
    ndarray, shape (n,)
        Loss modulus divided by storage modulus.
    """
    require_kind("model", model, FiniteElement)
    frequencies = finite_array("frequency", frequency, (1,), POSITIVE, "Hz")
    answer = ask("loss_factors", case=case_text(Case(model=model)), frequency=frequencies)
    return np.asarray(answer["loss_factors"])
