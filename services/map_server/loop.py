"""The loop of the map server: publishes the map once, latched, and serves requests for it."""

from __future__ import annotations

import math
from pathlib import Path

from messages.geometry import Point, Pose, Quaternion
from messages.nav import GetMapResponse, MapMetaData, OccupancyGrid
from messages.requests import STATIC_MAP
from messages.std import Header
from messages.topics import MAP, MAP_METADATA
from models.floor_plan import MapFile, read_map, read_occupancy
from services.map_server import MapServerParameters
from services.runtime.context import Context
from services.runtime.errors import BadInput


def run(ctx: Context[MapServerParameters]) -> None:
    """Publish at once, even before or without simulation time, and serve requests until asked to stop."""
    grid, map_file = read_grid(ctx.params)
    for note in map_file.notes:
        ctx.log.warn(note)
    ctx.publish(MAP, grid)
    ctx.publish(MAP_METADATA, grid.info)
    ctx.serve(STATIC_MAP, lambda _: GetMapResponse(map=grid))
    ctx.log.info(f"{map_file.image.name}: {grid.info.width} x {grid.info.height} cells of {grid.info.resolution:g} m")
    ctx.node.clock_patience_s = math.inf
    for _ in ctx.ticks():
        pass


def read_grid(p: MapServerParameters) -> tuple[OccupancyGrid, MapFile]:
    """Return the map named by the parameters, and its file; raises BadInput."""
    if not p.map:
        raise BadInput("map_server: no map is given: set map=PATH to a map.yaml")
    map_file = read_map(Path(p.map).expanduser().absolute())
    cells = read_occupancy(map_file)
    x, y, yaw = map_file.origin
    info = MapMetaData(
        resolution=map_file.resolution,
        width=cells.shape[1],
        height=cells.shape[0],
        origin=Pose(position=Point(x=x, y=y), orientation=Quaternion.from_yaw(yaw)),
    )
    return OccupancyGrid(header=Header(frame_id=p.frame_id), info=info, data=tuple(cells.ravel().tolist())), map_file
