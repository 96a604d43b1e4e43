"""Numbers as people read them: no rest of a calculation in the place of zero, no zero with a sign."""

from __future__ import annotations

NOTHING = 1e-6
"""What is smaller than this share of the numbers beside it is zero."""


def fixed(value: float, digits: int, sign: bool = False) -> str:
    """With so many digits behind the point; with ``sign``, a plus before what is above zero."""
    text = f"{value:{'+' if sign else ''}.{digits}f}"
    return text if float(text) else f"{0:.{digits}f}"


def plain(value: float, scale: float) -> str:
    """As short as it goes, beside numbers of the size ``scale``."""
    return "0" if abs(value) < NOTHING * abs(scale) or value == 0 else f"{value:.6g}"
