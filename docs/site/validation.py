"""Make the page `docs/validation.md` and its figures from the record `docs/validation.json`.

`./bootstrap validation` runs the tests that have oracles, which write the record, and then this.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import NullLocator

from thud.plot import COLORS, LINES, legend_above, own_style, save
from thud.plot.style import LEVEL, empty_axes, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOCS = Path(__file__).parents[1]
RECORD = DOCS / "validation.json"
PAGE = DOCS / "validation.md"
TEXT = Path(__file__).parent / "validation.md.in"
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# Kinds of oracles in the order of their strength, with what they are.
KINDS = {
    "closed form": "exact solutions",
    "convergence": "observed orders, and finer meshes",
    "balance": "residuals of momentum and energy, relative",
    "independent code": "independent programs with the same assumptions",
    "other model": "models of thud that share only the physics",
    "published example": "worked examples of standards",
    "published measurement": "",
    "paper": "",
    "standard": "limits of standards",
    "statistics": "many random records with known true values",
}


def number(value: float, unit: str) -> str:
    """Return a number of two digits with its unit."""
    if value and not 1e-3 <= abs(value) < 1e4:  # noqa: PLR2004 - as people write them
        mantissa, exponent = f"{value:.1e}".split("e")
        shown = f"{mantissa}·10{str(int(exponent)).translate(RAISED)}"
    else:
        shown = f"{value:.2g}"
    # Blanks that do not break.
    return f"{shown} {unit}".strip().replace(" ", "\u00a0")


def lists(oracles: list[dict[str, Any]]) -> str:
    """Return the lists of all kinds of oracles."""
    parts = []
    for kind, meaning in KINDS.items():
        rows = [
            f"- {o['what']}: {number(o['measured'], o['unit'])} ({number(o['bound'], o['unit'])})"
            for o in oracles
            if o["kind"] == kind
        ]
        title = f"### {kind.capitalize()}" + (f": {meaning}" if meaning else "")
        parts.append("\n".join([title, "", *rows]))
    return "\n\n".join(parts)


@own_style()
def draw_orders(curves: dict[str, Any]) -> Figure:
    """Draw errors against steps, with the fourth power."""
    figure, axes = empty_axes(2.4)
    for i, (name, curve) in enumerate(curves.items()):
        x, y = np.array(curve["x"]), np.array(curve["y"])
        axes.loglog(x, y, "os"[i], color=COLORS[i], markersize=4, label=name)
        fine = np.geomspace(x.min(), 1)
        axes.loglog(fine, y[0] * fine**4, color="0.5", linewidth=0.8, zorder=1)
    axes.lines[-1].set_label("fourth power")
    parts = [1, 2, 4, 8]
    axes.set_xticks([1 / part for part in parts], ["1", *(f"1/{part}" for part in parts[1:])])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("Step over the first")
    axes.set_ylabel("Relative error")
    legend_above(axes)
    return figure


@own_style()
def draw_codes(curves: dict[str, Any]) -> Figure:
    """Draw octaves of two impacts by thud and by other element codes, and the differences."""
    figure = new_figure(3.2)
    levels, change = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    cases: dict[str, dict[str, Any]] = {}
    for name, curve in curves.items():
        case, code = name.split(": ")
        cases.setdefault(case, {})[code] = np.array(curve["y"])
        octaves = curve["x"]
    place = np.arange(len(octaves))
    for i, (case, by) in enumerate(cases.items()):
        (other,) = by.keys() - {"thud"}
        marks = {"marker": "os"[i], "linestyle": "none", "color": COLORS[i], "markersize": 4.5}
        line = {"color": COLORS[i], "linestyle": LINES[i]}
        levels.plot(place, by["thud"], label=f"{case}: thud", **line)
        levels.plot(place, by[other], markerfacecolor="none", label=f"{case}: {other}", **marks)
        change.plot(place, by["thud"] - by[other], clip_on=False, **marks)
    change.axhline(0, color="0.4", linewidth=0.8, zorder=1)
    for axes in (levels, change):
        axes.margins(0.08, 0.2)
    levels.tick_params(labelbottom=False)
    change.set_xticks(place, [f"{octave:g}" for octave in octaves])
    change.set_xlabel("Octave band, Hz")
    change.set_ylabel("thud − other\ncode, dB")
    levels.set_ylabel(LEVEL.replace(", ", ",\n", 1))
    figure.align_ylabels()
    legend_above(levels)
    return figure


@own_style()
def draw_laws(curves: dict[str, Any]) -> Figure:
    """Draw three octaves against the order of the damping law, by thud and another code."""
    octaves = list(dict.fromkeys(name.split(": ")[0] for name in curves))
    figure = new_figure(0.4 + 0.9 * len(octaves))
    panels = figure.subplots(len(octaves), 1, sharex=True)
    for axes, octave in zip(panels, octaves, strict=True):
        for name, curve in curves.items():
            if name.startswith(octave):
                thud = name.endswith("thud")
                axes.plot(
                    curve["x"], curve["y"], "-" if thud else "o", color=COLORS[0 if thud else 1],
                    markerfacecolor="none", label=name.split(": ")[1],
                )  # fmt: skip
        middle = np.mean(axes.get_ylim())
        axes.set_ylim(middle - 1.5, middle + 1.5)
        axes.set_title(octave, loc="left")
        axes.tick_params(labelbottom=axes is panels[-1])
    panels[-1].set_xlabel("Order of the law")
    figure.supylabel(LEVEL)
    legend_above(panels[0])
    return figure


FIGURES = {
    "validation_orders": (draw_orders, "order of accuracy"),
    "validation_codes": (draw_codes, "element codes"),
    "validation_laws": (draw_laws, "damping laws"),
}


def page(record: dict[str, Any]) -> str:
    """Return the text of the page."""
    text = TEXT.read_text(encoding="utf-8")
    given = {
        "count": str(len(record["oracles"])),
        "version": record["version"],
        "date": record["date"],
        "lists": lists(record["oracles"]),
    }
    for name, value in given.items():
        text = text.replace(f"@{name}@", value)
    return text


if __name__ == "__main__":
    found = json.loads(RECORD.read_text(encoding="utf-8"))
    PAGE.write_text(page(found), encoding="utf-8")
    for name, (draw, figure) in FIGURES.items():
        save(draw(found["curves"][figure]), DOCS / "figures" / f"{name}.png")
