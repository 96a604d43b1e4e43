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
    """The recording itself, or a copy in ``folder`` without its torn end.

    Raises BadInput when neither can be read, or when what is left of it bears no time: the viewer would wait for it.
    """
    if not rrd.is_file():
        raise BadInput(f"no recording {rrd}")
    trouble = _trouble(rrd)
    if not trouble:
        if not _timed(rrd):
            raise BadInput(f"{rrd} holds shapes alone, nothing at any time: its writer ended before the run began")
        return rrd
    copy = folder / f"mended-{rrd.name}"
    try:
        subprocess.run([PROGRAM, "rrd", "optimize", rrd, "-o", copy], capture_output=True, timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        raise BadInput(f"{rrd} could not be mended within {PATIENCE_S:.0f} s of wall time") from None
    if not copy.is_file() or _trouble(copy):
        raise BadInput(f"{rrd} is not a recording that can be shown: {trouble}")
    if not _timed(copy):
        raise BadInput(
            f"{rrd} is cut off after {rrd.stat().st_size} bytes, before anything that moves was recorded, so there is "
            f"nothing to show: was it copied whole? ({trouble})"
        )
    return copy


def _trouble(rrd: Path) -> str:
    """Why rerun cannot read the file; empty when it can."""
    try:
        with warnings.catch_warnings(action="ignore"):
            held = RrdReader(rrd).recordings()
    except RuntimeError as error:
        return str(error)
    return "" if held else "it holds no recording"


def _timed(rrd: Path) -> bool:
    """Whether a recording holds anything at a time; raises BadInput for a damaged one."""
    try:
        with warnings.catch_warnings(action="ignore"):
            return any(chunk.timeline_names for chunk in RrdReader(rrd).stream())
    except RuntimeError as error:
        raise BadInput(f"{rrd} is damaged: {error}") from None
