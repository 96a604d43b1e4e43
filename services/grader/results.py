"""Writes the result files of the grader: measurements as JSON, trails as numpy arrays."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import msgspec
import numpy as np

from services.grader.arm import ArmMeter
from services.grader.records import (
    ARM_TRAIL_COLUMNS,
    MEASUREMENTS_FILE,
    ROBOT_TRAIL_COLUMNS,
    TRAJECTORIES_FILE,
    Measurements,
)
from services.grader.robot import RobotMeter
from services.runtime import atomic_file
from services.runtime.errors import BadInput


def prepare_folder(folder: Path) -> Path:
    """Create the folder and check that it can be written; raises BadInput now rather than after the run."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise BadInput(
            f"the output folder {folder} cannot be written ({error.strerror}): choose another, or change its rights"
        ) from None


def write_atomic(path: Path, content: bytes) -> None:
    """Put ``content`` in place of what ``path`` held; a reader sees the old or the new. Raises BadInput.

    It is on the disk when this returns, so that a power failure does not leave an empty file.
    """
    try:
        atomic_file.write_atomic(path, content, durable=True)
    except OSError as error:
        raise BadInput(f"{path} cannot be written: {error.strerror}") from None


def write_results(folder: Path, measurements: Measurements, robots: Mapping[str, RobotMeter | ArmMeter]) -> None:
    """Write both files, the figures last, so that the trails exist when they do. Raises BadInput."""
    arrays: dict[str, np.ndarray] = {}
    for name, meter in robots.items():
        columns = ARM_TRAIL_COLUMNS if isinstance(meter, ArmMeter) else ROBOT_TRAIL_COLUMNS
        arrays[f"{name}.trail"] = np.array(meter.trail.rows, float).reshape(-1, len(columns))
        if isinstance(meter, ArmMeter):
            continue
        reference = meter.progress.reference_path
        arrays[f"{name}.path"] = np.array(reference.corners if reference else (), float).reshape(-1, 2)
    packed = BytesIO()
    np.savez_compressed(packed, allow_pickle=False, **arrays)
    write_atomic(folder / TRAJECTORIES_FILE, packed.getvalue())
    write_atomic(folder / MEASUREMENTS_FILE, msgspec.json.format(msgspec.json.encode(measurements), indent=2) + b"\n")
