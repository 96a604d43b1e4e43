"""Axes, robot line styles, and the world below the paths: shared by the pictures of few and of many robots."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.collections import PolyCollection

from deploy.report.table import format_number
from models import palette
from services.grader.records import ROBOT_TRAIL_COLUMNS

Trails = dict[str, np.ndarray]
"""The arrays of the grader's trajectories file."""

INK, FAINT, GRID = "#22272e", "#8a929c", "#e6e9ed"

MAX_NAME_LENGTH = 28
"""Maximum length of a name in a legend."""

MAX_LINE_WIDTH, MIN_LINE_WIDTH = 2.5, 0.9
"""Line widths [points]: of lines that may overlap, the first is the widest and at the bottom."""
_DASHES: tuple[Any, ...] = ("-", (0, (7, 2)), (0, (4, 2)), (0, (2, 1.5)))


class LineStyle(NamedTuple):
    """The line style of one robot, so that overlapping lines stay visible."""

    colour: str
    width: float
    dash: Any
    order: float

    @property
    def plot_options(self) -> dict[str, Any]:
        """The style as Matplotlib's arguments."""
        return {"color": self.colour, "lw": self.width, "ls": self.dash, "zorder": 3 + self.order}


def line_styles(names: Iterable[str]) -> dict[str, LineStyle]:
    """Return a line style for each robot; a single robot has a solid line of the usual width."""
    each = list(names)
    if len(each) == 1:
        return {each[0]: LineStyle("", 1.3, "-", 0.0)}
    step = (MAX_LINE_WIDTH - MIN_LINE_WIDTH) / max(1, len(each) - 1)
    return {
        name: LineStyle("", MAX_LINE_WIDTH - step * index, _DASHES[index % len(_DASHES)], index / len(each))
        for index, name in enumerate(each)
    }


def coloured_line_styles(names: Iterable[str], among: Iterable[str]) -> dict[str, LineStyle]:
    """Return the line styles of robots in the colours that they have ``among`` all robots of the fleet."""
    colour = palette.colours(among)
    return {name: line._replace(colour=palette.hexadecimal(colour[name])) for name, line in line_styles(names).items()}


def shorten_name(name: str, most: int = MAX_NAME_LENGTH) -> str:
    """Shorten a name to ``most`` characters by cutting its beginning, since its end is more specific."""
    return name if len(name) <= most else f"\N{HORIZONTAL ELLIPSIS}{name[1 - most :]}"


def style_axes(axes: Any, title: str, x: str, y: str) -> None:
    """Set title, labels with units, tick numbers and grid."""
    axes.set_title(title, loc="left", fontsize=10.5, color=INK, fontweight="bold")
    axes.set_xlabel(x, fontsize=9, color=INK)
    axes.set_ylabel(y, fontsize=9, color=INK)
    axes.tick_params(labelsize=8.5, colors=INK, length=0)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(lambda value, _, axis=axis: format_number(value, _largest_tick(axis)))
    axes.grid(color=GRID, lw=0.8)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_visible(False)


def ensure_span(axes: Any, least: float) -> None:
    """Make the y axis span at least ``least``, in its unit: smaller values are rounding errors."""
    low, high = axes.get_ylim()
    if high - low < least:
        middle = (low + high) / 2
        axes.set_ylim(middle - least / 2, middle + least / 2)


def _largest_tick(axis: Any) -> float:
    """Return the largest absolute tick value of an axis."""
    low, high = axis.get_view_interval()
    return float(max(abs(low), abs(high)))


MIN_SPEED_SPAN, MIN_DISTANCE_SPAN = 0.01, 1e-5
"""Minimum span of the axes, m/s and m: smaller values are rounding errors."""

MIN_GROUND_SPAN_M = 2.0
"""Minimum span of the map [m]: a robot that stands still moves by nanometres."""


def ensure_ground(axes: Any) -> None:
    """Make a map span at least MIN_GROUND_SPAN_M around what is drawn on it."""
    middle = (axes.dataLim.min + axes.dataLim.max) / 2
    axes.update_datalim([middle - MIN_GROUND_SPAN_M / 2, middle + MIN_GROUND_SPAN_M / 2])


def base_column(trail: np.ndarray, name: str) -> np.ndarray:
    """Return a column of the trail of a robot that drives, shape (n,)."""
    column: np.ndarray = trail[:, ROBOT_TRAIL_COLUMNS.index(name)]
    return column


WORLD_MARGIN_M, WORLD_MARGIN_SHARE = 1.5, 0.2
"""Margin of the world around the driven paths: metres, or a share of their extent if that is larger."""

WORLD_FILL = 0.4
"""Opacity of the bodies of the world."""


def draw_world(axes: Any, arrays: Trails) -> None:
    """Draw the world's bodies below the paths: their outlines at the start, and the paths of those that moved.

    Only bodies near the driven paths are drawn, which ``axes`` already shows.
    """
    corners, counts = (arrays.get(f"world.{each}", np.empty(0)) for each in ("corners", "counts"))
    if not len(counts):
        return
    outlines = np.split(corners, np.cumsum(counts)[:-1])
    paths = np.split(arrays["world.paths"], np.cumsum(arrays["world.path_counts"])[:-1])
    colours = arrays["world.colours"]
    driven = np.array([axes.dataLim.min, axes.dataLim.max])
    margin = max(WORLD_MARGIN_M, WORLD_MARGIN_SHARE * float(np.ptp(driven, axis=0).max()))
    low, high = driven[0] - margin, driven[1] + margin
    for outline in outlines:
        near, far = np.maximum(outline.min(axis=0), low), np.minimum(outline.max(axis=0), high)
        if (near <= far).all():
            axes.update_datalim([near, far])
    of_body = colours[arrays["world.bodies"]]
    faces = np.column_stack((of_body[:, :3], of_body[:, 3] * WORLD_FILL))
    alone = np.bincount(arrays["world.bodies"])[arrays["world.bodies"]] == 1  # no inner edges of meshes
    edges = [FAINT if each else "none" for each in alone]
    axes.add_collection(PolyCollection(outlines, facecolors=faces, edgecolors=edges, lw=0.8, zorder=0.7), autolim=False)
    for path, colour in zip(paths, colours, strict=True):
        if len(path):
            axes.plot(path[:, 0], path[:, 1], color=colour[:3], lw=1.1, ls=(0, (2, 2)), alpha=0.8, zorder=0.8)
