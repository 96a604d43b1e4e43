"""Bags as the viewer itself understands them: for those that hold no robot of ours."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from services.logger.viewer import PROGRAM
from services.runtime.errors import BadInput

PATIENCE_S = 300.0
"""Wall time given to the conversion."""


def convert(files: Sequence[Path], rrd: Path) -> None:
    """Write the MCAP ``files`` as one recording; raises BadInput when the viewer cannot read them."""
    with tempfile.TemporaryDirectory() as folder:
        parts = []
        for number, file in enumerate(files):
            parts.append(Path(folder) / f"{number}.rrd")
            _run("mcap", "convert", str(file), "-o", str(parts[-1]))
        if len(parts) > 1:
            _run("rrd", "merge", *map(str, parts), "-o", str(rrd))
        else:
            try:
                rrd.write_bytes(parts[0].read_bytes())
            except OSError as error:
                raise BadInput(f"{rrd} cannot be written: {error.strerror}") from None


def _run(*arguments: str) -> None:
    try:
        done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise BadInput(f"the viewer's converter failed: {error}") from None
    if done.returncode:
        said = done.stderr.strip().splitlines()
        raise BadInput(f"the viewer cannot read {arguments[2]}: {said[-1] if said else f'status {done.returncode}'}")
