"""Reads a recording with rerun's own reader, as plain numbers."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rerun.chunk import Chunk, RrdReader

Stamps = NDArray[np.int64]


def columns(file: Path, entity: str, component: str, timeline: str = "sim_time") -> tuple[Stamps, list[Any]]:
    """Return times [ns] and cells of a component of an entity, in order of time."""
    times: list[int] = []
    cells: list[Any] = []
    for chunk in chunks(file):
        if chunk.entity_path == entity and not chunk.is_static and timeline in chunk.timeline_names:
            batch = chunk.to_record_batch()
            if component in batch.schema.names:
                times += batch.column(timeline).cast("int64").to_pylist()
                cells += batch.column(component).to_pylist()
    order = np.argsort(np.array(times, np.int64), kind="stable")
    return np.array(times, np.int64)[order], [cells[i] for i in order]


def chunks(file: Path) -> Iterator[Chunk]:
    """Yield all chunks; the footer may be missing."""
    with warnings.catch_warnings(action="ignore"):
        reader = RrdReader(file)
    yield from reader.stream()


def table(file: Path, entity: str, timeline: str = "sim_time") -> tuple[Stamps, NDArray[np.float64]]:
    """Return times [ns] and values, shape (n, series), of a plot."""
    times, cells = columns(file, entity, "Scalars:scalars", timeline)
    return times, np.array(cells, np.float64)


def poses(file: Path, robot: str, frame: str, timeline: str = "sim_time") -> tuple[Stamps, NDArray[np.float64]]:
    """Return times [ns] and x, y, z, qx, qy, qz, qw, shape (n, 7), of the transforms to a robot's frame."""
    entity = f"/{robot}/tf"
    times, frames = columns(file, entity, "Transform3D:child_frame", timeline)
    _, places = columns(file, entity, "Transform3D:translation", timeline)
    _, turns = columns(file, entity, "Transform3D:quaternion", timeline)
    mine = [i for i, each in enumerate(frames) if each == [f"{robot}/{frame}"]]
    return times[mine], np.array([places[i][0] + turns[i][0] for i in mine])


def entities(file: Path) -> Iterator[str]:
    """Yield the entities that have data in the recording."""
    yield from {chunk.entity_path for chunk in chunks(file)}
