"""Maps of worlds: drawn from above, written, and read back."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from deploy.commands.world import command
from deploy.world_map import world_map
from messages.errors import BadInput
from messages.se3 import Pose3
from models import WORLDS
from models.bodies import BodyPart, BodyPath, BoxShape, CylinderShape, MeshShape, RampShape, WorldBody, WorldDescription
from models.mesh import Mesh
from models.world import read_world


def test_a_map_has_what_stands_in_a_robot_s_way() -> None:
    corners = np.array([(-1, 0, 0), (1, 0, 0), (1, 0, 2), (-1, 0, 2)], float)
    wall = Mesh(corners, np.array([(0, 1, 2), (0, 2, 3)], np.int32))
    legs = [BodyPart(BoxShape((0.1, 0.1, 0.7)), Pose3((x, 0.0, 0.35))) for x in (-0.5, 0.5)]
    path = BodyPath(((0.0, 5.0, 0.2), (1.0, 5.0, 0.2)), 1.0)
    world = WorldDescription(
        bodies=(
            WorldBody("pillar", (BodyPart(CylinderShape(0.5, 2.0)),), Pose3((3.0, 0.0, 1.0))),
            WorldBody("wall", (BodyPart(MeshShape(wall)),), Pose3((0.0, 3.0, 0.0))),
            WorldBody("table", (*legs, BodyPart(BoxShape((1.2, 0.6, 0.05)), Pose3((0.0, 0.0, 0.72)))), mass=3.0),
            WorldBody("cart", (BodyPart(BoxShape((0.5, 0.5, 0.4))),), Pose3((0.0, 5.0, 0.2)), path=path),
            WorldBody("ramp", (BodyPart(RampShape((1.0, 1.0, 0.2)), ground=True),), Pose3((-3.0, 0.0, 0.1))),
        )
    )
    drawn = world_map(world, 0.05, 0.5)

    def occupied(x: float, y: float) -> bool:
        column, row = int((x - drawn.origin[0]) / 0.05), int((y - drawn.origin[1]) / 0.05)
        return bool(drawn.occupied[len(drawn.occupied) - 1 - row, column])

    for x, y in [(3.0, 0.0), (3.47, 0.0), (2.7, 0.3), (-0.9, 2.98), (0.9, 2.98), (-0.5, 0.0), (0.5, 0.0)]:
        assert occupied(x, y), (x, y)
    for x, y in [(3.4, 0.4), (0.0, 0.0), (0.0, 2.8), (1.2, 3.0)]:
        assert not occupied(x, y), (x, y)
    assert drawn.occupied.sum() == pytest.approx((0.25 * np.pi + 0.02) / 0.05**2 + 40, rel=0.12)
    with pytest.raises(BadInput, match="cells, the limit is"):
        world_map(world, 0.001, 0.5)


def test_the_command_writes_a_map_that_is_the_same_world(tmp_path: Path) -> None:
    runner, file = CliRunner(), tmp_path / "arena.yaml"
    done = runner.invoke(command, ["map", "arena", "-o", str(file)])
    assert done.exit_code == 0, done.output
    again = read_world(str(file))
    (plan,) = again.bodies
    assert len(plan.parts) < 120
    first, second = (world_map(world, 0.05, 0.5) for world in (read_world("arena"), again))
    assert abs(int(first.occupied.sum()) - int(second.occupied.sum())) < 0.05 * first.occupied.sum()
    done = runner.invoke(command, ["check", str(file)])
    assert "1 body (1 fixed)" in done.output
    done = runner.invoke(command, ["list"])
    assert [line.split()[0] for line in done.output.splitlines()] == list(WORLDS)
    with pytest.raises(BadInput, match=r"must end with \.yaml or \.yml"):
        runner.invoke(command, ["map", "arena", "-o", str(tmp_path / "arena.pgm")], catch_exceptions=False)
