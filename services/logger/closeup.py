"""A close view of one robot: the layout that a recording opens in, with the eye beside the robot and its own plots."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader

from services.logger import paths
from services.logger.body import MARGIN, STANDING_HEIGHT
from services.runtime.errors import BadInput

Layout = dict[str, Any]
Place = tuple[float, float, float]

AWAY = (-0.45, -0.75, 0.55)
"""From where the eye looks at a robot, in units of its distance: from the south-west and above."""

NEAR, WIDTHS = 0.7, 5.0
"""Distance of the eye: so many metres, and so many radii of the robot more."""


def robots_of(rrd: Path) -> dict[str, float]:
    """The robots of a recording, each with the radius [m] of what it takes on the ground; 0 for an arm."""
    found: dict[str, float] = {}
    for chunk in RrdReader(rrd).stream():
        name, _, rest = chunk.entity_path.removeprefix("/").partition("/")
        if rest == "marker/name":
            found.setdefault(name, 0.0)
        elif rest == "marker":
            radii = chunk.to_record_batch().column("Cylinders3D:radii").to_pylist()
            found[name] = float(radii[0][0]) - MARGIN
    return found


def place_of(rrd: Path, robot: str, timeline: str, at: float) -> Place:
    """Where a robot's base truly is ``at`` [s], m; raises BadInput when the recording does not tell."""
    latest, place = -1, None
    for chunk in RrdReader(rrd).stream():
        if chunk.entity_path != paths.transforms(robot) or timeline not in chunk.timeline_names:
            continue
        batch = chunk.to_record_batch()
        times = np.array(batch.column(timeline).cast("int64").to_pylist(), np.int64)
        parents = batch.column("Transform3D:parent_frame").to_pylist()
        spots = batch.column("Transform3D:translation").to_pylist()
        for time, parent, spot in zip(times, parents, spots, strict=True):
            if parent == ["world"] and latest < time <= round(at * 1e9):
                latest, place = int(time), spot[0]
    if place is None:
        raise BadInput(f"{rrd}: it is not known where {robot} is at {at:g} s of simulation time")
    return float(place[0]), float(place[1]), float(place[2])


def closeup(layout: Layout, radius: float, robot: str, place: Place) -> Layout:
    """The layout of a viewer with the eye beside ``robot`` at ``place`` and its plots in front, up to the cursor."""
    made = copy.deepcopy(layout)
    for path, parts in layout.items():
        name = parts.get("ViewBlueprint", {}).get("display_name")
        if name == "World":
            made[f"{path}/EyeControls3D"] = {"EyeControls3D": _eye(place, radius)}
        if "TimeAxis" in parts:
            made[path]["TimeAxis"]["view_range"] = {"start": "Infinite", "end": {"CursorRelative": 0}}
        own = parts.get("ContainerBlueprint", {})
        if own.get("display_name") == "plots":
            for each in own["contents"]:
                if layout.get(f"/{each}", {}).get("ContainerBlueprint", {}).get("display_name") == robot:
                    made[path]["ContainerBlueprint"]["active_tab"] = each
    return made


def _eye(place: Place, radius: float) -> dict[str, list[float]]:
    stands = radius <= 0
    away = NEAR + WIDTHS * (STANDING_HEIGHT / 3 if stands else radius)
    height = STANDING_HEIGHT / 2 if stands else radius / 2
    target = [place[0], place[1], place[2] + height]
    # An arm swings in its x-z plane and is best seen along y.
    side = (-0.25, -0.9, 0.3) if stands else AWAY
    return {
        "position": [each + away * part for each, part in zip(target, side, strict=True)],
        "look_target": target,
        "eye_up": [0.0, 0.0, 1.0],
    }
