"""Bodies of a world in both engines: visible, solid, pushable, moving on paths, and repeatable."""

import math

import numpy as np
import pytest

from messages.se3 import Pose3
from models import urdf_path
from models.bodies import BodyPart, BodyPath, BoxShape, CylinderShape, HeightMapShape, MeshShape, RampShape, SphereShape
from models.mesh import Mesh
from models.world import WorldBody, WorldDescription
from services.runtime.errors import BadInput
from services.sim.physics.world import Body, BodyState, CameraModel, Contact, Motor, World
from services.sim.physics.world_bodies import MAX_TRIANGLES
from tests.services.sim.physics.driven_robot import STEP_NS, NewWorld

pytestmark = pytest.mark.slow

SECOND = 1_000_000_000 // STEP_NS
CORNER = Mesh(
    np.array([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 0, 1), (2, 0, 1), (2, 2, 1)], np.float64),
    np.array([(0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4)], np.int32),
)
"""Two walls at a right angle, along y = 0 and x = 2; their convex hull would fill the corner."""


def body(name: str, shape: object, *place: float, **more: object) -> WorldBody:
    ground = isinstance(shape, RampShape | HeightMapShape)
    return WorldBody(name, (BodyPart(shape, ground=ground),), Pose3(place), **more)  # type: ignore[arg-type]


def burger(name: str = "robot", *place: float) -> Body:
    motors = (Motor("wheel_left_joint", 1.0), Motor("wheel_right_joint", 1.0))
    return Body(name, urdf_path("burger"), Pose3(place) if place else Pose3(), motors)  # type: ignore[arg-type]


def slope(rows: int = 41) -> HeightMapShape:
    """Return a height map of 4 m by 4 m that rises along x from 0 to 0.4 m."""
    return HeightMapShape(np.tile(np.linspace(0, 0.4, rows), (rows, 1)), (4.0, 4.0))


def test_rays_meet_every_shape_where_it_is(new_world: NewWorld) -> None:
    world = WorldDescription(
        bodies=(
            body("ball", SphereShape(0.3), 2, 0, 1),
            body("pillar", CylinderShape(0.2, 2.0), 0, 2, 1),
            body("ramp", RampShape((1.0, 1.0, 0.5)), -2, 0, 0.25),
            body("corner", MeshShape(CORNER), 4, 4, 0),
            body("hill", slope(), 0, -10, 0.1),
            WorldBody("shown", (BodyPart(BoxShape((1, 1, 1)), solid=False),), Pose3((8, 0, 0.5))),
        )
    )
    with new_world(world) as on:

        def distance(start: tuple[float, ...], end: tuple[float, ...]) -> float:
            fraction = float(on.cast_rays(np.array([start], float), np.array([end], float))[0])
            return fraction * math.dist(start, end)

        assert distance((0, 0, 1), (4, 0, 1)) == pytest.approx(1.7, abs=1e-3)
        assert distance((0, 0, 1.5), (0, 4, 1.5)) == pytest.approx(1.8, abs=1e-3)
        assert distance((-2.25, 0, 2), (-2.25, 0, -1)) == pytest.approx(2 - 0.125, abs=2e-3)
        assert distance((5, 5, 0.5), (9, 5, 0.5)) == pytest.approx(1.0, abs=2e-3)  # not where the hull would be
        assert distance((5, 5, 0.5), (5, 0, 0.5)) == pytest.approx(1.0, abs=2e-3)
        for x in (-1.5, 0.0, 1.2):
            assert distance((x, -10.3, 3), (x, -10.3, 0)) == pytest.approx(3 - 0.1 - (x + 2) / 10, abs=1e-3), x
        assert distance((7, 0, 0.5), (9, 0, 0.5)) == math.inf


def test_the_camera_sees_the_colours_of_bodies(new_world: NewWorld) -> None:
    green = BodyPart(slope(), colour=(0.0, 1.0, 0.0, 1.0), ground=True)
    blue = BodyPart(MeshShape(CORNER), colour=(0.0, 0.0, 1.0, 1.0))
    unseen = BodyPart(BoxShape((4.0, 4.0, 0.1)), Pose3((0.0, 0.0, 2.0)), visible=False)
    lens = CameraModel(16, 12, 0.6, 0.05, 20.0)
    above, south = (
        Pose3((0.0, 0.0, 4.0), (1.0, 0.0, 0.0, 0.0)),
        Pose3((1.0, -3.0, 0.5), (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)),
    )
    for part, eye in ((green, above), (blue, south)):
        with new_world(WorldDescription(bodies=(WorldBody("seen", (part, unseen)),))) as on:
            pixels = np.frombuffer(on.render(eye, lens), np.uint8).reshape(12, 16, 3)
        middle = pixels[6, 8].astype(int)
        assert middle.argmax() == np.argmax(part.colour[:3])
        assert middle.max() > 2 * np.sort(middle)[1]


def test_a_movable_body_is_pushed_and_comes_back_with_a_reset(new_world: NewWorld) -> None:
    legs = [BodyPart(BoxShape((0.05, 0.05, 0.4)), Pose3((x, y, 0.2))) for x in (-0.25, 0.25) for y in (-0.25, 0.25)]
    table = WorldBody("table", (BodyPart(BoxShape((0.6, 0.6, 0.05)), Pose3((0, 0, 0.425))), *legs), mass=2.0)
    world = WorldDescription(
        bodies=(body("crate", BoxShape((0.3, 0.3, 0.3)), 0.5, 3, 0.15, mass=0.2, friction=0.2), table)
    )
    with new_world(world) as on:
        assert on.world_bodies == ("crate", "table")
        robot = on.spawn(burger("robot", 0, 3, 0))
        for _ in range(3 * SECOND):
            robot.set_speeds((6.0, 6.0))
            on.step()
        (contact,) = on.contacts()
        assert contact == Contact("robot", "crate")
        pushed = on.world_body_state("crate")
        assert pushed.position[0] > 0.65
        assert pushed.linear[0] > 0.1
        stands = on.world_body_state("table")
        assert stands.position == pytest.approx((0, 0, 0), abs=1e-3)
        on.reset()
        assert on.world_body_state("crate").position == pytest.approx((0.5, 3, 0.15))
        with pytest.raises(BadInput, match=r"'crate' at x 0\.050 m.* would overlap with 'robot'"):
            on.set_state("crate", BodyState((0.05, 3, 0.15), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
        with pytest.raises(BadInput, match=r"'other' at .* would overlap with crate"):
            on.spawn(burger("other", 0.5, 3.0, 0.0))
        with pytest.raises(BadInput, match="'crate' is an obstacle of this world"):
            on.spawn(burger("crate", 5.0, 3.0, 0.0))
        on.set_state("crate", BodyState((5, 5, 0.15), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
        on.spawn(burger("other", 0.5, 3.0, 0.0))
        with pytest.raises(BadInput, match="unknown movable body 'crat'; did you mean 'crate'"):
            on.world_body_state("crat")


def test_what_starts_inside_something_is_told(new_world: NewWorld) -> None:
    crate = BoxShape((0.2, 0.2, 0.2))
    world = WorldDescription(
        bodies=(
            body("wall", BoxShape((0.1, 2.0, 1.0)), 0, 0, 0.5),
            body("beside", crate, 0.5, 0, 0.1, mass=1.0),
            body("sunk", crate, 2, 0, 0.0, mass=1.0),
            body("in_wall", crate, 0.1, 0, 0.1, mass=1.0),
        )
    )
    with new_world(world) as on:
        told = on.overlaps_at_start()
    assert [each.split(" ")[0] for each in told] == ["'sunk'", "'in_wall'"]
    assert "would overlap with the ground by 0.100 m" in told[0]
    assert "would overlap with wall by 0.050 m" in told[1]


def test_a_thrown_body_of_several_parts_spins_about_its_centre_of_mass(new_world: NewWorld) -> None:
    """A hammer with its head 0.9 m from its origin turns about its centre of mass, which starts at rest and falls."""
    parts = BodyPart(BoxShape((1.0, 0.1, 0.1))), BodyPart(BoxShape((0.2, 0.5, 0.5)), Pose3((0.9, 0.0, 0.0)))
    hammer = WorldBody("hammer", parts, Pose3((0.0, 0.0, 20.0)), mass=3.0)
    with new_world(WorldDescription(bodies=(hammer,))) as on:
        centre = 0.9 * 0.05 / 0.06  # weighted by volume, 0.01 and 0.05 m3
        start = BodyState((0, 0, 20), (0, 0, 0, 1), (0, -2.0 * centre, 0), (0, 0, 2.0))
        on.set_state("hammer", start)
        for kept, wanted in zip(on.world_body_state("hammer"), start, strict=True):
            assert kept == pytest.approx(wanted)
        for _ in range(SECOND):
            on.step()
        state = on.world_body_state("hammer")
        yaw = Pose3(state.position, state.orientation).rpy[2]
        assert yaw == pytest.approx(2.0, abs=0.02)
        x, y = state.position[0] + centre * math.cos(yaw), state.position[1] + centre * math.sin(yaw)
        assert (x, y) == pytest.approx((centre, 0.0), abs=0.01)


def test_a_moving_body_keeps_to_its_path_and_pushes_what_is_in_its_way(new_world: NewWorld) -> None:
    path = BodyPath(((0.0, 0.0, 0.3), (2.0, 0.0, 0.3)), 0.5, "there_and_back", pause=0.5)
    world = WorldDescription(
        bodies=(
            body("cart", BoxShape((0.4, 0.4, 0.5)), 0, 0, 0.3, path=path),
            body("crate", BoxShape((0.2, 0.2, 0.2)), 1.0, 0, 0.1, mass=2.0),
        )
    )
    with new_world(world) as on:
        robot = on.spawn(burger("robot", -0.6, 0, 0))
        for step in range(1, 12 * SECOND):
            on.step()
            state, wanted = on.world_body_state("cart"), path.position_at(step * STEP_NS / 1e9)
            assert state.position == pytest.approx(wanted, abs=1e-5), step
            if step == SECOND:
                assert state.linear == pytest.approx((0.5, 0, 0))
        assert on.world_body_state("crate").position[0] == pytest.approx(2.3 + 0.5**2 / (2 * 0.5 * 9.81), abs=0.005)
        assert robot.state().position[0] < -0.5
        assert on.contacts() in ((), (Contact("robot", "cart"),))
        with pytest.raises(BadInput, match="'cart' follows its path"):
            on.set_state("cart", BodyState((5, 5, 1), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
        on.reset()
        assert on.world_body_state("cart").position == pytest.approx((0, 0, 0.3))
        for _ in range(2 * SECOND):
            on.step()
        with pytest.raises(BadInput, match="would overlap with cart"):
            on.spawn(burger("late", *path.position_at(2.0)[:2], 0.0))


def test_runs_with_bodies_repeat_bit_for_bit_also_after_a_reset(new_world: NewWorld) -> None:
    path = BodyPath(((1.0, -1.0, 0.25), (1.0, 1.0, 0.25)), 0.7, "loop", pause=0.1)
    world = WorldDescription(
        bodies=(
            body("ball", SphereShape(0.1), 0.4, 0.02, 0.1, mass=0.3),
            body("cart", CylinderShape(0.2, 0.4), 1, -1, 0.25, path=path),
            body("ramp", RampShape((1.0, 1.0, 0.1)), 2, 0, 0.05),
            body("hill", slope(), -3, 0, 0),
        )
    )

    def run(on: World) -> list[BodyState]:
        states = []
        for _ in range(2 * SECOND):
            on.body("robot").set_speeds((6.0, 5.5))
            on.step()
            states += [on.body("robot").state(), *(on.world_body_state(name) for name in on.world_bodies)]
        return states

    runs = []
    for _ in range(2):
        with new_world(world) as on:
            on.spawn(burger())
            runs.append(run(on))
            on.reset()
            runs.append(run(on))
    assert runs[0] == runs[1] == runs[2] == runs[3]


def test_a_robot_drives_up_ramps_and_height_maps_without_a_collision(new_world: NewWorld) -> None:
    hill = slope()
    for world, start, rise in [
        (WorldDescription(bodies=(body("ramp", RampShape((3.0, 1.0, 0.3)), 2, 0, 0.15),)), 0.0, 0.1),
        (WorldDescription(bodies=(body("hill", hill, 2, 0, 0),)), 1.0, 0.1),
    ]:
        with new_world(world) as on:
            height = on.ground_height(start, 0.0, 0.1)
            robot = on.spawn(burger("robot", start, 0.0, height))
            touched = set()
            for _ in range(8 * SECOND):
                robot.set_speeds((6.0, 6.0))
                on.step()
                touched |= set(on.contacts())
            x, y, z = robot.state().position
            assert x > start + 1.2
            assert abs(y) < 0.05
            assert z == pytest.approx((x - (0.5 if start == 0 else 0.0)) * rise, abs=0.02)
            assert not touched


def test_below_a_height_map_nothing_is_spawned(new_world: NewWorld) -> None:
    with new_world(WorldDescription(bodies=(body("hill", slope(), 0, 0, 0),))) as on:
        with pytest.raises(BadInput, match=r"below the height map, whose ground is 0\.300 m high"):
            on.spawn(burger("robot", 1.0, 0.0, 0.0))
        assert on.ground_height(1.0, 0.0, 0.2) == pytest.approx(0.32, abs=1e-3)
        assert on.ground_height(9.0, 0.0, 0.2) == 0.0


def test_a_mesh_of_many_triangles_is_loaded_in_pieces(new_world: NewWorld) -> None:
    rows = 205
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, rows)), axis=-1).reshape(-1, 2)
    index = np.arange(rows * rows).reshape(rows, rows)
    a, b, c, d = (each.ravel() for each in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    triangles = np.concatenate([np.column_stack((a, b, c)), np.column_stack((a, c, d))]).astype(np.int32)
    mesh = Mesh(np.column_stack((grid, np.full(len(grid), 0.5))), triangles)
    assert len(triangles) > MAX_TRIANGLES
    with new_world(WorldDescription(bodies=(body("table", MeshShape(mesh), 0, 0, 0),))) as on:
        places = np.array([(x, x / 2, 2.0) for x in np.linspace(-0.95, 0.95, 40)])
        assert on.cast_rays(places, places - (0, 0, 2)) == pytest.approx(0.75, abs=1e-3)
