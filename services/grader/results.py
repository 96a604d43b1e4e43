"""Writes the result files of the grader: measurements as JSON, trails as numpy arrays."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
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
    WORLD_ARRAYS,
    Measurements,
)
from services.grader.robot import RobotMeter
from services.markers.world_bodies import World
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
    """Replace the content of ``path`` atomically: readers see the old or the new content. Raises BadInput.

    The content is on disk when this returns, so that a power failure does not leave an empty file.
    """
    try:
        atomic_file.write_atomic(path, content, durable=True)
    except OSError as error:
        raise BadInput(f"{path} cannot be written: {error.strerror}") from None


def world_arrays(world: World, paths: Mapping[str, Sequence[tuple[float, float]]]) -> dict[str, np.ndarray]:
    """Return the bodies of the world, and the paths that they moved by name, in the format of WORLD_ARRAYS."""
    outlines = [(index, part.polygon()) for index, (_, parts) in enumerate(world) for part in parts]
    moved = [path if len(path := paths.get(body.name, ())) > 1 else () for body, _ in world]
    arrays = (
        np.concatenate([np.empty((0, 2)), *(outline for _, outline in outlines)]),
        np.array([len(outline) for _, outline in outlines], int),
        np.array([index for index, _ in outlines], int),
        np.array([body.colour for body, _ in world]).reshape(-1, 4),
        np.concatenate([np.empty((0, 2)), *(np.array(each).reshape(-1, 2) for each in moved)]),
        np.array([len(each) for each in moved], int),
    )
    return dict(zip(WORLD_ARRAYS, arrays, strict=True))


def write_results(
    folder: Path,
    measurements: Measurements,
    robots: Mapping[str, RobotMeter | ArmMeter],
    world: Mapping[str, np.ndarray] | None = None,
) -> None:
    """Write both files, the measurements last, so that the trails exist when they do; ``world`` is from
    ``world_arrays``.

    Raises BadInput.
    """
    arrays: dict[str, np.ndarray] = dict(world or world_arrays((), {}))
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
