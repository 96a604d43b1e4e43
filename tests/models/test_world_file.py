"""World files: their content, and errors with file and line."""

import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from models.bodies import BodyPath, BoxShape, CylinderShape, HeightMapShape, MeshShape, RampShape
from models.world import BadWorld, read_world

BODY = """
[[bodies]]
name = "pillar"
shape = "cylinder"
radius = 0.15
length = 1.0
position = [1.0, 2.0, 0.5]
colour = "red"
"""

CART = """
[[obstacles]]
name = "cart"
shape = "box"
size = [0.4, 0.4, 0.4]
path = [[0, 0], [2, 0, 1]]
speed = 1.0
pause = 0.5
"""

PYRAMID = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"


def test_a_file_may_hold_bodies_of_every_shape_and_kind(tmp_path: Path) -> None:
    (tmp_path / "pyramid.obj").write_text(PYRAMID)
    Image.fromarray(np.array([[0, 255, 0], [0, 0, 0]], np.uint8)).save(tmp_path / "hills.png")
    file = tmp_path / "world.toml"
    file.write_text(
        'about = "all"\nfriction = 0.8\n'
        '[[boxes]]\nname = "old"\nsize = [1, 1, 1]\nposition = [5, 5, 0.5]\n'
        + BODY
        + '[[bodies]]\nname = "ball"\nshape = "sphere"\nradius = 0.1\nmass = 0.4\nfriction = 0.3\n'
        '[[bodies]]\nname = "ramp"\nshape = "ramp"\nsize = [2, 1, 0.3]\nyaw = 1.0\n'
        '[[bodies]]\nname = "roof"\nshape = "mesh"\nfile = "pyramid.obj"\nscale = [2, 2, 1]\nrpy = [0, 0, 0.5]\n'
        '[[bodies]]\nname = "hills"\nshape = "height_map"\nimage = "hills.png"\nresolution = 0.5\nheight = [-1, 1]\n'
        + CART
        + '[[lights]]\nname = "sun"\ndirection = [0, 0, -1]\n'
    )
    world = read_world("world.toml", tmp_path)
    assert [body.name for body in world.all_bodies] == ["old", "pillar", "ball", "ramp", "roof", "hills", "cart"]
    assert [body.kind for body in world.bodies] == ["fixed", "movable", "fixed", "fixed", "fixed", "moving"]
    pillar, ball, ramp, roof, hills, cart = world.bodies
    assert pillar.parts[0].shape == CylinderShape(0.15, 1.0)
    assert pillar.parts[0].colour == (0.75, 0.15, 0.12, 1.0)
    assert ball.pose.position == (0.0, 0.0, 0.1)
    assert (ball.mass, ball.friction) == (0.4, 0.3)
    assert ramp.parts[0].shape == RampShape((2, 1, 0.3))
    assert [body.name for body in world.bodies if body.parts[0].ground] == ["ramp", "hills"]
    mesh = roof.parts[0].shape
    assert isinstance(mesh, MeshShape)
    assert mesh.file == tmp_path / "pyramid.obj"
    assert mesh.mesh.bounds.tolist() == [[-2, -2, 0], [2, 2, 1]]
    heights = hills.parts[0].shape
    assert isinstance(heights, HeightMapShape)
    assert heights.size == (1.0, 0.5)
    assert heights.heights.tolist() == [[-1, -1, -1], [-1, 1, -1]]  # the image's top row is at +y
    assert cart.path == BodyPath(((0, 0, 0.2), (2, 0, 1)), 1.0, "there_and_back", 0.5)
    assert [light.name for light in world.lights] == ["sun"]


def test_a_path_is_passed_at_its_speed_with_its_pauses() -> None:
    points = ((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 1.0, 0.0))
    back = BodyPath(points, 1.0, "there_and_back", pause=0.5, start=1.0)
    for seconds, x, y in [
        (0, 0, 0),
        (1.5, 0, 0),  # it pauses at its first point, too
        (2.5, 1, 0),
        (3.7, 2, 0),
        (4.5, 2, 0.5),
        (5.3, 2, 1),
        (6.0, 2, 0.5),
        (7.5, 1.5, 0),
        (9.2, 0, 0),
        (1.5 + 8, 0, 0),
        (2.5 + 8, 1, 0),
        (2.5 + 80, 1, 0),
    ]:
        assert back.position_at(seconds) == pytest.approx((x, y, 0)), seconds
    loop = BodyPath(points, 1.0, "loop")
    assert loop.position_at(3 + 5**0.5 / 2) == pytest.approx((1, 0.5, 0))
    assert loop.position_at(3 + 5**0.5 + 1) == pytest.approx((1, 0, 0))
    once = BodyPath(points, 2.0, "once")
    assert once.position_at(100) == (2.0, 1.0, 0.0)
    assert BodyPath(points[:1], 1.0, "loop").position_at(3) == points[0]


def test_what_is_wrong_is_told_with_file_line_and_the_right_name(tmp_path: Path) -> None:
    file, text = tmp_path / "world.toml", BODY + CART
    for wrong, right, line, told in [
        ('"cylinder"', '"cilinder"', 4, "unknown shape 'cilinder'; did you mean 'cylinder'?"),
        ("radius", "radios", 5, "unknown key 'radios'; did you mean 'radius'?"),
        ("0.15", "nan", 5, "radius: Expected `float` >= 0.0001"),
        ("0.15", "-0.15", 5, "radius: Expected `float` >= 0.0001"),
        ("2.0", "inf", 7, "position[1]: Expected `float` <= 10000"),
        ('"red"', '"rde"', 8, "unknown colour 'rde'; did you mean 'red'?"),
        ('"cart"', '"pillar"', 11, "there is a body 'pillar' already"),
        ("path =", "mass = 1.0\npath =", 14, "'cart': a body with a path cannot be pushed"),
        ("path = [[0, 0], [2, 0, 1]]\n", "", 10, "'cart': an obstacle needs a path"),
        ("position", "fixed = false\nposition", 7, "'pillar': a body that can be moved needs a mass"),
        ('shape = "box"\nsize', 'shape = "mesh"\nfile = "no.stl"\nrpy', 13, "no.stl cannot be read"),
        ('"red"', '"red', 8, "this is not TOML"),
        ("0.15", "2" * 5000, 1, "this is not TOML: Exceeds the limit"),
        ('"red"', '"red"\nyaw = 45', 9, "yaw: 45 rad is more than a whole turn, 6.28: angles are in rad"),
        ('"red"', '"red"\nrpy = [0, 0, 90]', 9, "rpy[2]: 90 rad is more than a whole turn, 6.28"),
        ("[[bodies]]", "start = { x = 0, yw = 1 }\n[[bodies]]", 2, "unknown key 'yw'; did you mean 'yaw'?"),
        ("[[bodies]]", "start = { yaw = 90 }\n[[bodies]]", 2, "start.yaw: 90 rad is more than a whole turn, 6.28"),
        (
            "[[bodies]]",
            'plan = "rooms.png"\nresolution = 0.1\norigin = [0, 0, 90]\n[[bodies]]',
            2,
            "origin: 90 rad is more than a whole turn, 6.28",
        ),
        ("[[bodies]]", 'plan = "rooms.png"\n[[bodies]]', 2, "a plan needs a resolution"),
    ]:
        file.write_text(text.replace(wrong, right, 1))
        with pytest.raises(BadWorld) as error:
            read_world(str(file))
        assert str(error.value).startswith(f"{file}:{line}: "), error.value
        assert told in str(error.value)
    file.write_text("[[boxes]]\n" * 100_000)
    with pytest.raises(BadWorld, match=r"\[\[boxes\]\] has 100,000 entries, the limit of a world is 5,000"):
        read_world(str(file))
    with open(tmp_path / "large.stl", "wb") as mesh:  # 2 million triangles, none of which are read
        mesh.write(bytes(80) + (2_000_000).to_bytes(4, "little"))
        mesh.truncate(84 + 50 * 2_000_000)
    file.write_text('[[bodies]]\nname = "statue"\nshape = "mesh"\nfile = "large.stl"\n')
    with pytest.raises(BadWorld, match=rf"^{file}:4: 'statue': .*large\.stl has 100000084 bytes, the limit of a mesh"):
        read_world(str(file))
    with pytest.raises(BadWorld, match=f"there is no world file .*; did you mean '{file.name}'"):
        read_world(f"{file.stem}s.toml", tmp_path)


def test_a_huge_picture_is_refused_by_its_header(tmp_path: Path) -> None:
    """20,000 by 20,000 pixels: 400 MB that are never decoded."""
    size = (20_000).to_bytes(4, "big")
    chunks = [(b"IHDR", size + size + bytes([8, 0, 0, 0, 0])), (b"IDAT", b"nothing")]
    picture = b"\x89PNG\r\n\x1a\n"
    for kind, data in chunks:
        picture += len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big")
    (tmp_path / "rooms.png").write_bytes(picture)
    file = tmp_path / "world.toml"
    file.write_text('about = "large"\nplan = "rooms.png"\nresolution = 0.05\n')
    with pytest.raises(BadWorld) as error:
        read_world(str(file))
    assert str(error.value).startswith(f"{file}:2: {tmp_path}/rooms.png: ")
    assert "the 16,777,216 pixels that a floor plan has at most" in str(error.value)


def test_boxes_still_stand_where_they_did() -> None:
    red = next(box for box in read_world("arena").boxes if box.name == "red_box")
    body = red.body()
    assert body.kind == "fixed"
    assert body.parts[0].shape == BoxShape((0.4, 0.4, 0.4))
    assert body.pose.rpy == pytest.approx((0, 0, 0.5))
