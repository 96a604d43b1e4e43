"""Reading all bodies at once gives the same as reading each alone, bit for bit."""

from __future__ import annotations

import numpy as np

from messages.base import encode
from messages.std import Time
from models.model import read_model
from models.world import Box, WorldDescription
from services.sim.noise import NoiseSource
from services.sim.physics.bullet import MAX_RAYS
from services.sim.physics.world import BodyState
from services.sim.sensors import laser_ranges
from services.sim.snapshot import FEW, Snapshot
from tests.services.sim.physics.driven_robot import NewWorld, placement_at, robot_body

WALL = Box(name="wall", size=(0.2, 8.0, 1.0), position=(2.1, 0.0, 0.5))


def test_all_bodies_at_once(new_world: NewWorld) -> None:
    laser = read_model("burger").laser
    assert laser is not None
    with new_world(WorldDescription(boxes=(WALL,))) as world:
        for number in range(FEW + 2):
            row, column = divmod(number, 3)
            pose = placement_at(0.6 * column, 0.6 * row + 0.2 * column, 0.9 * number)
            world.spawn(robot_body(f"tb3_{number}", "burger", pose))
        for _ in range(100):
            for place, name in enumerate(world.names):
                world.body(name).set_speeds((3.0 + place, 4.0 - place))
            world.step()
        names = world.names
        assert [BodyState.of_numbers(row) for row in world.states().tolist()] == [
            world.body(name).state() for name in names
        ]
        readings = [world.body(name).joint_readings() for name in names]
        assert world.joint_readings().tolist() == np.concatenate(readings, axis=1).tolist()
        links = [("tb3_2", "base_scan"), ("tb3_0", "imu_link"), ("tb3_1", "base_footprint")]
        poses = [world.body(body).link_pose(link) for body, link in links]
        assert [(tuple(row[:3]), tuple(row[3:])) for row in world.link_poses(links).tolist()] == poses

        links = [(name, link) for name in names for link in world.body(name).links]
        assert [tuple(row) for row in world.link_states(links).tolist()] == [
            world.body(name).link_state(link).numbers for name, link in links
        ]

        every, single = Snapshot(world, 5, 1), Snapshot(world, 5, 1)
        every.read_states(names)
        every.read_joints(names)
        single.read_states(names[:1])
        for name in names:
            assert (every.state(name), every.joints(name)) == (single.state(name), single.joints(name))
        for chosen in (names, names[1:], names[::-1], names[2:5], names[:1], ()):
            expected = np.concatenate((np.empty((3, 0)), *(readings[names.index(name)] for name in chosen)), axis=1)
            for snapshot in (every, Snapshot(world, 5, 1)):
                assert snapshot.joint_rows(chosen).tolist() == expected.tolist()
        assert every.states(names[1:]).tolist() == [list(each.numbers) for each in map(single.state, names[1:])]
        assert single.states(names[:1]).tolist() == every.states(names[:1]).tolist()
        assert every.stamp == single.stamp == encode(Time.of(5))

        noise = [NoiseSource(1, name, "scan", 40, laser.samples).at(40) for name in names]
        together = laser_ranges(world, names, laser, noise)
        for name, row, own in zip(names, together, noise, strict=True):
            alone = laser_ranges(world, [name], laser, [own])
            assert row.tobytes() == alone.tobytes()
        assert np.isfinite(together).any()

        starts = np.tile((-1.0, 0.0, 0.5), (MAX_RAYS + 2, 1))
        ends = starts + np.linspace(1.0, 9.0, len(starts))[:, None] * (1.0, 0.0, 0.0)
        fractions = world.cast_rays(starts, ends)
        assert fractions.shape == (MAX_RAYS + 2,)
        assert fractions[-3:].tolist() == world.cast_rays(starts[-3:], ends[-3:]).tolist()
        assert np.isinf(fractions[0])
