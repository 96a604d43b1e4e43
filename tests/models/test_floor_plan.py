"""Floor plans: walls from an image, and map.yaml."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from messages.errors import BadInput
from models.bodies import BoxShape
from models.floor_plan import rectangles, write_map
from models.world import BadWorld, WorldBody, read_world


def rooms(edge: int = 2000) -> NDArray[np.bool_]:
    """Return a plan (true is wall): outer walls, a cross of inner ones with a door in each arm, and a slanting one."""
    walls = np.zeros((edge, edge), bool)
    wall, half, door = edge // 100, edge // 2, edge // 20
    walls[:wall] = walls[-wall:] = walls[:, :wall] = walls[:, -wall:] = True
    walls[half : half + wall] = walls[:, half : half + wall] = True
    for place in (edge // 4, 3 * edge // 4):
        walls[half : half + wall, place : place + door] = walls[place : place + door, half : half + wall] = False
    for step in range(200):
        walls[edge // 10 + step, edge // 10 + step : edge // 10 + step + wall] = True
    return walls


def covered(parts: list[tuple[int, int, int, int]], shape: tuple[int, ...]) -> NDArray[np.int_]:
    counts = np.zeros(shape, int)
    for top, left, bottom, right in parts:
        counts[top:bottom, left:right] += 1
    return counts


def test_few_rectangles_cover_the_walls_exactly() -> None:
    walls = rooms()
    parts = list(rectangles(walls))
    assert np.array_equal(covered(parts, walls.shape), walls)
    assert len(parts) < 250  # 200 of them are the steps of the slanting wall
    random = np.random.default_rng(1).random((40, 60)) < 0.4
    assert np.array_equal(covered(list(rectangles(random)), random.shape), random)
    assert list(rectangles(np.zeros((3, 4), bool))) == []
    with pytest.raises(BadInput, match="more than 5000 boxes"):
        list(rectangles(np.indices((400, 400)).sum(axis=0) % 2 == 0))


def footprints(body: WorldBody) -> list[tuple[float, ...]]:
    """Return centre (x, y) and size (x, y) [m] of a plan's boxes in its own frame."""
    found = []
    for part in body.parts:
        assert isinstance(part.shape, BoxShape)
        found.append((*part.pose.position[:2], *part.shape.size[:2]))
    return found


def test_a_plan_stands_where_its_picture_has_it(tmp_path: Path) -> None:
    pixels = np.full((4, 6), 255, np.uint8)
    pixels[0, :] = 0  # the northern wall
    pixels[3, 5] = 0  # a pixel at the lower right
    pixels[2, 2] = 120  # too light
    Image.fromarray(pixels).save(tmp_path / "rooms.png")
    file = tmp_path / "world.toml"
    file.write_text('plan = "rooms.png"\nresolution = 0.5\norigin = [1.0, 2.0, 0.1]\nwall_height = 2.0\n')
    (plan,) = read_world(str(file)).bodies
    assert (plan.name, plan.kind) == ("plan", "fixed")
    assert plan.pose.position == (1.0, 2.0, 0.0)
    assert plan.pose.rpy == pytest.approx((0, 0, 0.1))
    assert footprints(plan) == [(1.5, 1.75, 3.0, 0.5), (2.75, 0.25, 0.5, 0.5)]
    assert {(part.shape.size[2], part.pose.position[2]) for part in plan.parts} == {(2.0, 1.0)}  # type: ignore[union-attr]
    file.write_text('plan = "rooms.png"\nresolution = 0.5\noccupied_thresh = 0.5\n')
    assert len(read_world(str(file)).bodies[0].parts) == 3
    file.write_text('plan = "rooms.png"\nresolution = 0.5\nnegate = true\n')
    assert sum(x * y for _, _, x, y in footprints(read_world(str(file)).bodies[0])) == pytest.approx(16 * 0.25)


def test_a_map_is_written_and_read_again(tmp_path: Path) -> None:
    walls = rooms(300)
    free = ~walls
    free[:50] = False
    write_map(tmp_path / "map.yaml", walls, free, 0.05, (-7.5, -7.5, 0.0))
    cells = np.asarray(Image.open(tmp_path / "map.pgm"))
    assert set(np.unique(cells)) == {0, 205, 254}
    (plan,) = read_world("map.yaml", tmp_path).bodies
    assert plan.pose.position == (-7.5, -7.5, 0.0)
    assert sum(x * y for _, _, x, y in footprints(plan)) == pytest.approx(walls.sum() * 0.05**2)


def test_a_wrong_map_is_told_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "map.yaml"
    right = "image: map.pgm\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n"
    (tmp_path / "map.pgm").write_bytes(b"P5\n2 2\n255\n" + bytes([0, 254, 254, 0]))
    file.write_text(right)
    assert len(read_world(str(file)).bodies[0].parts) == 2
    file.write_text(right + "author: nobody\n")
    assert read_world(str(file)).notes == (f"{file}:6: author: it is not understood, and ignored",)
    for wrong, instead, told in [
        ("0.05", "-1", f"{file}:2: resolution: Expected `float` > 0.0"),
        ("0.05", ".nan", f"{file}:2: resolution: Expected `float` > 0.0"),
        ("[0.0, 0.0, 0.0]", "[0.0]", f"{file}:3: origin: Expected `array` of length 3, got 1"),
        ("negate", "negated", f"{file}:4: unknown key 'negated'; did you mean 'negate'?"),
        ("resolution: 0.05\n", "", f"{file}: this is not a map.yaml: the key resolution is missing"),
        ("map.pgm", "no.pgm", f"{tmp_path}/no.pgm cannot be read"),
        ("image", "image: [", f"{file}: "),
        ("occupied_thresh: 0.65", "occupied_thresh: 1.0", "the plan has no wall"),
    ]:
        file.write_text(right.replace(wrong, instead, 1))
        with pytest.raises(BadWorld) as error:
            read_world(str(file))
        assert told in str(error.value)
