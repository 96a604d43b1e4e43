"""How every plot of the picture looks: colours, lines that lie on each other, numbers, and axes without clutter."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from deploy.report.numbers import plain
from models import palette

INK, FAINT, GRID = "#22272e", "#8a929c", "#e6e9ed"

LONGEST_NAME = 28
"""Characters of a name in a legend."""

WIDEST, THINNEST = 2.5, 0.9
"""Points; of lines that may lie on each other the first is the widest and lies below."""
_DASHES: tuple[Any, ...] = ("-", (0, (7, 2)), (0, (4, 2)), (0, (2, 1.5)))


class Line(NamedTuple):
    """How the line of one robot is drawn: where several lie on each other, each is still to be seen."""

    colour: str
    width: float
    dash: Any
    order: float

    @property
    def drawn(self) -> dict[str, Any]:
        """As Matplotlib takes it."""
        return {"color": self.colour, "lw": self.width, "ls": self.dash, "zorder": 3 + self.order}


def lines(names: Iterable[str]) -> dict[str, Line]:
    """A line for each of some robots; a robot alone has a solid one of the usual width."""
    each = list(names)
    if len(each) == 1:
        return {each[0]: Line("", 1.3, "-", 0.0)}
    step = (WIDEST - THINNEST) / max(1, len(each) - 1)
    return {
        name: Line("", WIDEST - step * index, _DASHES[index % len(_DASHES)], index / len(each))
        for index, name in enumerate(each)
    }


def coloured(names: Iterable[str], among: Iterable[str]) -> dict[str, Line]:
    """The lines of robots in the colours that they have ``among`` all robots of the fleet."""
    colour = palette.colours(among)
    return {name: line._replace(colour=palette.hexadecimal(colour[name])) for name, line in lines(names).items()}


def shortened(name: str, most: int = LONGEST_NAME) -> str:
    """A name of at most ``most`` characters: its end tells more than its beginning."""
    return name if len(name) <= most else f"\N{HORIZONTAL ELLIPSIS}{name[1 - most :]}"


def dress(axes: Any, title: str, x: str, y: str) -> None:
    """Title, labels with units, numbers and grid."""
    axes.set_title(title, loc="left", fontsize=10.5, color=INK, fontweight="bold")
    axes.set_xlabel(x, fontsize=9, color=INK)
    axes.set_ylabel(y, fontsize=9, color=INK)
    axes.tick_params(labelsize=8.5, colors=INK, length=0)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(lambda value, _, axis=axis: plain(value, _reach(axis)))
    axes.grid(color=GRID, lw=0.8)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_visible(False)


def widen(axes: Any, least: float) -> None:
    """Let the y axis span ``least`` at least, in its unit: what lies far below is a rest of a calculation."""
    low, high = axes.get_ylim()
    if high - low < least:
        middle = (low + high) / 2
        axes.set_ylim(middle - least / 2, middle + least / 2)


def _reach(axis: Any) -> float:
    """The largest number on an axis, without sign."""
    low, high = axis.get_view_interval()
    return float(max(abs(low), abs(high)))
