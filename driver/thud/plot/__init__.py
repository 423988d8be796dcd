"""Figures, each in a file of its own.

A file holds the function that draws its figure, as wide as a column of a journal page, and declares
where it belongs: ``thud-driver run`` leaves ``IMPACT_FIGURES`` and ``MODES_FIGURES`` beside the
results of a case, ``thud-driver figures`` draws ``DOCUMENTATION_FIGURES``.
"""

from thud.plot.catalogue import case_figures as case_figures
from thud.plot.catalogue import documentation_figures as documentation_figures
from thud.plot.comparison import comparison_page as comparison_page
from thud.plot.design_map import draw_design_map as draw_design_map
from thud.plot.fit import draw_fit as draw_fit
from thud.plot.force_history import force_history as force_history
from thud.plot.level_changes import level_changes as level_changes
from thud.plot.levels import levels as levels
from thud.plot.look import COLOURS as COLOURS
from thud.plot.look import COMPACT as COMPACT
from thud.plot.look import FORMATS as FORMATS
from thud.plot.look import LINES as LINES
from thud.plot.look import MARKERS as MARKERS
from thud.plot.look import SIZE as SIZE
from thud.plot.look import WIDTH as WIDTH
from thud.plot.look import add_curves as add_curves
from thud.plot.look import dress as dress
from thud.plot.look import empty_axes as empty_axes
from thud.plot.look import legend_above as legend_above
from thud.plot.look import octave_axis as octave_axis
from thud.plot.look import save as save
from thud.plot.look import save_all as save_all
from thud.plot.loss_factor import loss_factor as loss_factor
from thud.plot.modes import mode_shapes as mode_shapes
from thud.plot.motion import animate as animate
from thud.plot.motion import motion as motion
from thud.plot.sensitivity import draw_sensitivity as draw_sensitivity
from thud.plot.sweep import draw_sweep as draw_sweep
from thud.plot.uncertainty import draw_uncertainty as draw_uncertainty
