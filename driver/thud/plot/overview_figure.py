"""Force and octave levels of one impact."""

from matplotlib.figure import Figure

from thud.base._schema import LimitsSource
from thud.impact.impact import Impact
from thud.plot.force_history_figure import draw_forces
from thud.plot.levels_figure import draw_levels
from thud.plot.style import SIZE, legend_above, level_label, new_figure, own_style, style_axes
from thud.recordings.recording import Recording


@own_style()
def overview(impact: Impact | Recording, source: LimitsSource = "rubber_ball") -> Figure:
    """Draw the force that counts and its octave levels.

    The limits are those of the source of a case; a recording has none, its source is given.
    """
    name = "recording"
    if isinstance(impact, Impact):
        source = impact.case.limits.source
        name = impact.case.model.name.replace("_", " ") if impact.case.model else ""
    named = {name: impact}
    figure = new_figure(5)
    history, octaves = figure.subplots(2, 1)
    draw_forces(style_axes(history), named, None)
    draw_levels({"octave": octaves}, named, None, source)
    octaves.set_ylabel(level_label(named, None), fontsize=SIZE)
    legend_above(octaves)
    return figure
