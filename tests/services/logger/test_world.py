"""The world in a recording: shapes of bodies, and the motion of dynamic ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from messages.gazebo import WorldStates
from messages.geometry import Point, Pose, Quaternion, Vector3
from messages.rosgraph import Clock
from messages.std import ColorRGBA, Header, Time
from messages.topics import CLOCK, WORLD_MARKERS, WORLD_STATES
from messages.visualization import Marker, MarkerArray
from models.mesh import Mesh, write_stl
from models.world import read_world
from services.logger.rebuild import RecordingBuilder
from services.logger.world_scene import WorldScene
from services.sim.world_markers import world_markers
from tests.services.logger.conftest import EXTENT
from tests.services.logger.recording_reader import columns, entities

SIZE, GREEN = Vector3(x=1.0, y=1.0, z=1.0), ColorRGBA(g=1.0, a=1.0)
CORNERS = ((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))


def marker(name: str, kind: str, shape: int, number: int, **more: object) -> Marker:
    return Marker(ns=kind, text=name, id=number, type=shape, scale=SIZE, color=GREEN, **more)  # type: ignore[arg-type]


def test_bodies_of_all_shapes_stand_in_a_recording_and_those_that_move_do(tmp_path: Path) -> None:
    """Written from a bag's messages, in the same way as live by the logger."""
    stl = tmp_path / "wedge of mine.stl"
    write_stl(stl, _wedge())
    points = tuple(Point(x=x, y=y, z=z) for face in FACES for x, y, z in (CORNERS[corner] for corner in face))
    array = MarkerArray(
        markers=(
            *world_markers(read_world("arena")).markers,
            marker("a/ball", "moving", Marker.SPHERE, 100, pose=Pose(position=Point(x=9.0))),
            marker("post", "fixed", Marker.CYLINDER, 101),
            marker("pile", "fixed", Marker.TRIANGLE_LIST, 102, points=points, colors=(GREEN,) * len(points)),
            marker("mesh", "fixed", Marker.MESH_RESOURCE, 103, mesh_resource=stl.as_uri()),
            marker("gone", "fixed", Marker.MESH_RESOURCE, 104, mesh_resource=(tmp_path / "no.stl").as_uri()),
            marker("remote", "fixed", Marker.MESH_RESOURCE, 105, mesh_resource="http://example.org/a.stl"),
            marker("cloud", "fixed", 8, 106),
        )
    )
    file, warned = tmp_path / "run.rrd", list[str]()
    with RecordingBuilder(file, [], EXTENT, warned.append) as built:
        built.add(CLOCK.name, Clock(), 0)
        built.add(WORLD_MARKERS.name, array, 0)
        for step in range(1, 4):
            turned = Pose(position=Point(x=float(step)), orientation=Quaternion.from_yaw(1.0))
            states = WorldStates(
                header=Header(stamp=Time.of(step * 10**8)), name=("a/ball", "other"), pose=(turned, turned)
            )
            built.add(WORLD_STATES.name, states, step * 10**8)
        built.add(CLOCK.name, Clock(epoch=1), 0)
    assert [text.split(" is not drawn")[0] for text in warned] == ["gone", "remote", "cloud"]
    drawn = {each for each in entities(file) if each.startswith("/world/bodies/")}
    assert {
        rf"/world/bodies/{each}/0" for each in ("wall_north", "red_box", r"a\/ball", "post", "pile", "mesh")
    } <= drawn
    assert not any("ground" in each or "gone" in each for each in drawn)
    times, places = columns(file, "/world/tf", "Transform3D:translation")
    assert (times // 10**8).tolist() == [0, 1, 2, 3]
    assert [place[0][0] for place in places] == pytest.approx([9.0, 1.0, 2.0, 3.0])
    assert [each[0] for each in columns(file, "/world/tf", "Transform3D:child_frame")[1]] == ["world/a/ball"] * 4
    again, _ = columns(file, "/world/tf", "Transform3D:translation", "sim_time_2")
    assert again.tolist() == [0], "after a reset it is where it began"


def test_the_first_view_is_of_the_world_unless_an_extent_is_given() -> None:
    arena = WorldScene(world_markers(read_world("arena")), pytest.fail)
    assert arena.extent == pytest.approx((-4.1, -4.1, 4.1, 4.1))
    assert WorldScene(world_markers(read_world("empty")), pytest.fail).extent is None


def _wedge() -> Mesh:
    return Mesh(np.array(CORNERS), np.array(FACES, np.int32))
