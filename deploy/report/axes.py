"""How every plot of the picture looks: colours, and axes without clutter."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Okabe and Ito's colours, distinct to colour-blind eyes as well; yellow left out for its contrast on white."""
INK, FAINT, GRID = "#22272e", "#8a929c", "#e6e9ed"


def colours(names: Iterable[str]) -> dict[str, str]:
    """A colour for each name; they repeat after the last."""
    return {name: COLOURS[index % len(COLOURS)] for index, name in enumerate(names)}


def dress(axes: Any, title: str, x: str, y: str) -> None:
    """Title, labels and grid."""
    axes.set_title(title, loc="left", fontsize=10.5, color=INK, fontweight="bold")
    axes.set_xlabel(x, fontsize=9, color=INK)
    axes.set_ylabel(y, fontsize=9, color=INK)
    axes.tick_params(labelsize=8.5, colors=INK, length=0)
    axes.grid(color=GRID, lw=0.8)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_visible(False)
