"""Force and octave levels of one impact."""

from matplotlib.figure import Figure

from thud.impact.impact import Impact
from thud.plot.force_history_figure import draw_forces
from thud.plot.levels_figure import draw_levels
from thud.plot.style import SIZE, legend_above, level_label, new_figure, own_style, style_axes


@own_style()
def overview(impact: Impact) -> Figure:
    """Draw the assessed force and its octave levels."""
    name = impact.case.model.name.replace("_", " ") if impact.case.model else ""
    named = {name: impact}
    figure = new_figure(5)
    history, octaves = figure.subplots(2, 1)
    draw_forces(style_axes(history), named, None)
    draw_levels({"octave": octaves}, named, None, impact.limits_source)
    octaves.set_ylabel(level_label(named, None), fontsize=SIZE)
    legend_above(octaves)
    return figure
