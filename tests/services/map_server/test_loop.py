"""The map server publishes a file's map as ROS's does, latched and on request."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from messages.nav import GetMap
from messages.requests import STATIC_MAP
from messages.topics import MAP, MAP_METADATA
from services.map_server import SERVICE, MapServerParameters
from services.map_server.loop import read_grid
from services.runtime.errors import BadInput
from services.runtime.testing import run_service


def write_map(folder: Path, mode: str = "trinary", rows: str = "0 205\n254 100") -> str:
    (folder / "map.pgm").write_text(f"P2\n2 2\n255\n{rows}\n")
    path = folder / "map.yaml"
    path.write_text(
        f"image: map.pgm\nmode: {mode}\nresolution: 0.5\norigin: [-1.0, -2.0, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return str(path)


def test_the_map_is_published_once_and_answered(tmp_path: Path) -> None:
    with run_service(SERVICE, "/", MapServerParameters(map=write_map(tmp_path))) as service:
        grid = service.next(MAP)
        assert (grid.header.frame_id, grid.info.width, grid.info.height, grid.info.resolution) == ("map", 2, 2, 0.5)
        assert (grid.info.origin.position.x, grid.info.origin.position.y) == (-1.0, -2.0)
        assert grid.data == (0, -1, 100, -1), "from the lower left corner on; the grey of 100 is neither"
        assert service.next(MAP_METADATA) == grid.info
        assert service.call(STATIC_MAP, GetMap()).map == grid


def test_scaled_and_raw_maps_keep_what_is_between(tmp_path: Path) -> None:
    scaled, _ = read_grid(MapServerParameters(map=write_map(tmp_path, "scale", "0 127\n254 100")))
    assert scaled.data == (0, 89, 100, 67)
    raw, _ = read_grid(MapServerParameters(map=write_map(tmp_path, "raw", "0 101\n100 50")))
    assert raw.data == (100, 50, 0, -1)


def test_bad_maps_are_refused_with_their_place(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"map=PATH to a map\.yaml"):
        read_grid(MapServerParameters())
    bad = Path(write_map(tmp_path))
    bad.write_text(bad.read_text().replace("resolution: 0.5", "resolution: fine"))
    with pytest.raises(BadInput, match=r"map\.yaml:3: resolution: "):
        read_grid(MapServerParameters(map=str(bad)))
    with pytest.raises(BadInput, match=r"none\.yaml"):
        read_grid(MapServerParameters(map=str(tmp_path / "none.yaml")))


@pytest.mark.slow
def test_a_large_map_fits_in_a_message(tmp_path: Path) -> None:
    edge = 2500
    path = Path(write_map(tmp_path))
    (tmp_path / "map.pgm").write_bytes(
        f"P5\n{edge} {edge}\n255\n".encode() + np.full(edge * edge, 205, np.uint8).tobytes()
    )
    with run_service(SERVICE, "/", MapServerParameters(map=str(path))) as service:
        assert len(service.next(MAP).data) == edge * edge
