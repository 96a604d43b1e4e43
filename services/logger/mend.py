"""Recordings whose writer was killed: the last message may be torn, and rerun refuses such a file as it is."""

from __future__ import annotations

import subprocess
import warnings
from pathlib import Path

from rerun.chunk import RrdReader

from services.logger.viewer import PROGRAM
from services.runtime.errors import BadInput

PATIENCE_S = 120.0
"""Wall time given to the repair."""


def readable(rrd: Path, folder: Path) -> Path:
    """The recording itself, or a copy in ``folder`` without its torn end; raises BadInput when neither can be read."""
    if not rrd.is_file():
        raise BadInput(f"no recording {rrd}")
    trouble = _trouble(rrd)
    if not trouble:
        return rrd
    copy = folder / f"mended-{rrd.name}"
    try:
        subprocess.run([PROGRAM, "rrd", "optimize", rrd, "-o", copy], capture_output=True, timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        raise BadInput(f"{rrd} could not be mended within {PATIENCE_S:.0f} s of wall time") from None
    if not copy.is_file() or _trouble(copy):
        raise BadInput(f"{rrd} is not a recording that can be shown: {trouble}")
    return copy


def _trouble(rrd: Path) -> str:
    """Why rerun cannot read the file; empty when it can."""
    try:
        with warnings.catch_warnings(action="ignore"):
            held = RrdReader(rrd).recordings()
    except RuntimeError as error:
        return str(error)
    return "" if held else "it holds no recording"
