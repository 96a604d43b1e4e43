"""The files of the grader: the figures as JSON, the trails as numpy arrays."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import msgspec
import numpy as np

from services.grader.arm import ArmMeter
from services.grader.folder import write_whole
from services.grader.records import ARM_COLUMNS, MEASUREMENTS_FILE, TRAIL_COLUMNS, TRAJECTORIES_FILE, Measurements
from services.grader.robot import RobotMeter


def store(folder: Path, measurements: Measurements, robots: Mapping[str, RobotMeter | ArmMeter]) -> None:
    """Write both files; the figures come last, so whoever finds them finds the trails too. Raises BadInput."""
    arrays: dict[str, np.ndarray] = {}
    for name, meter in robots.items():
        columns = ARM_COLUMNS if isinstance(meter, ArmMeter) else TRAIL_COLUMNS
        arrays[f"{name}.trail"] = np.array(meter.trail.rows, float).reshape(-1, len(columns))
        if isinstance(meter, ArmMeter):
            continue
        reference = meter.progress.reference
        arrays[f"{name}.path"] = np.array(reference.corners if reference else (), float).reshape(-1, 2)
    packed = BytesIO()
    np.savez_compressed(packed, allow_pickle=False, **arrays)
    write_whole(folder / TRAJECTORIES_FILE, packed.getvalue())
    write_whole(folder / MEASUREMENTS_FILE, msgspec.json.format(msgspec.json.encode(measurements), indent=2) + b"\n")
