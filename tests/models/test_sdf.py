"""SDF worlds: parsed content, notes about unsupported elements, and errors."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from messages.se3 import Pose3
from models.bodies import BoxShape, CylinderShape, HeightMapShape, MeshShape, SphereShape
from models.sdf import read_sdf_model
from models.world import BadWorld, WorldBody, WorldDescription, read_world

WORLD = """<?xml version="1.0"?>
<!-- a comment -- with dashes -->
<sdf version="1.7">
  <world name="yard">
    <physics type="ode"/>
    <include><uri>model://sun</uri></include>
    <model name="ground_plane"><static>true</static><link name="link">
      <collision name="c"><geometry><plane><normal>0 0 1</normal><size>100 100</size></plane></geometry></collision>
    </link></model>
    <model name="wall">
      <static>1</static>
      <pose>1 2 0 0 0 1.5707963267948966</pose>
      <link name="link">
        <pose>1 0 0 0 0 0</pose>
        <collision name="c">
          <pose>0 0 0.5 0 0 0</pose>
          <geometry><box><size>2 0.2 1</size></box></geometry>
          <surface><friction><ode><mu>0.9</mu></ode></friction></surface>
        </collision>
        <visual name="v">
          <pose>0 0 0.5 0 0 0</pose>
          <geometry><box><size>2 0.2 1</size></box></geometry>
          <material><ambient>1 0 0 1</ambient><diffuse>0 1 0 0.5</diffuse></material>
        </visual>
      </link>
    </model>
    <model name="crate">
      <pose>0 0 1 0 0 0</pose>
      <link name="body">
        <inertial><mass>2.5</mass><inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.3</izz></inertia></inertial>
        <collision name="c">
          <geometry><cylinder><radius>0.2</radius><length>0.5</length></cylinder></geometry>
        </collision>
        <visual name="v"><geometry><sphere><radius>0.3</radius></sphere></geometry></visual>
      </link>
    </model>
    <model name="door">
      <pose>5 0 0 0 0 0</pose>
      <link name="post"><collision name="c"><geometry><box><size>0.1 0.1 2</size></box></geometry></collision></link>
      <link name="leaf">
        <pose relative_to="post">0.5 0 0 0 0 0</pose>
        <collision name="c"><geometry><box><size>0.9 0.05 2</size></box></geometry></collision>
      </link>
      <joint name="hinge" type="revolute"><parent>post</parent><child>leaf</child></joint>
      <plugin name="p" filename="libsomething.so"/>
    </model>
    <model name="pair">
      <link name="one"><collision name="c"><geometry><sphere><radius>0.1</radius></sphere></geometry></collision></link>
      <link name="two">
        <pose>1 0 0 0 0 0</pose>
        <collision name="c"><geometry><sphere><radius>0.1</radius></sphere></geometry></collision>
      </link>
      <model name="inner"><pose>0 1 0 0 0 0</pose><link name="l">
        <collision name="c"><geometry><sphere><radius>0.2</radius></sphere></geometry></collision></link></model>
    </model>
    <include><uri>model://box</uri><name>first</name><pose>3 3 0 0 0 0</pose></include>
    <include><uri>model://box</uri><static>true</static></include>
    <include><uri>model://box</uri></include>
    <include><uri>https://fuel.gazebosim.org/1.0/OpenRobotics/models/Radio</uri></include>
    <zeppelin/>
  </world>
</sdf>
"""

BOX = """<sdf version="1.6"><model name="box"><pose>0 0 0.25 0 0 0</pose><link name="l">
<inertial><mass>1</mass></inertial>
<collision name="c"><geometry><box><size>0.5 0.5 0.5</size></box></geometry></collision>
</link></model></sdf>"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package with Gazebo's layout: worlds/, and models/ with one model."""
    model = tmp_path / "package" / "models" / "box"
    (tmp_path / "package" / "worlds").mkdir(parents=True)
    model.mkdir(parents=True)
    (model / "model-1_6.sdf").write_text(BOX)
    (model / "model.config").write_text(
        "<model><name>Box</name><sdf version='1.4'>model.sdf</sdf><sdf version='1.6'>model-1_6.sdf</sdf></model>"
    )
    return tmp_path / "package"


def read(package: Path, text: str) -> WorldDescription:
    (package / "worlds" / "yard.world").write_text(text)
    return read_world("worlds/yard.world", package)


def test_models_become_bodies_with_their_poses_shapes_and_names(package: Path) -> None:
    world = read(package, WORLD)
    bodies = {body.name: body for body in world.bodies}
    assert list(bodies) == ["wall", "crate", "door", "pair::inner", "pair::one", "pair::two", "first", "box", "box_0"]
    assert [body.kind for body in world.bodies] == [
        *("fixed", "movable", "fixed", "movable", "movable", "movable", "movable", "fixed", "movable")
    ]
    assert (world.about, [light.name for light in world.lights]) == ("yard", ["sun"])
    wall = bodies["wall"]
    (part,) = wall.parts
    assert part.shape == BoxShape((2, 0.2, 1))
    assert (part.solid, part.visible, part.colour, wall.friction) == (True, True, (0, 1, 0, 0.5), 0.9)
    assert (wall.pose @ part.pose).position == pytest.approx((1, 3, 0.5))
    crate = bodies["crate"]
    assert (crate.mass, crate.moments, crate.pose.position) == (2.5, (0.1, 0.2, 0.3), (0, 0, 1))
    assert [(each.shape, each.solid, each.visible) for each in crate.parts] == [
        (CylinderShape(0.2, 0.5), True, False),
        (SphereShape(0.3), False, True),
    ]
    leaf = bodies["door"].parts[1]
    assert (bodies["door"].pose @ leaf.pose).position == pytest.approx((5.5, 0, 0))
    assert bodies["pair::two"].pose.position == (1, 0, 0)
    assert bodies["pair::inner"].pose.position == (0, 1, 0)
    assert bodies["first"].pose.position == pytest.approx((3, 3, 0))  # overrides the model's own pose
    assert bodies["box"].pose.position == pytest.approx((0, 0, 0.25))
    file = package / "worlds" / "yard.world"
    told = {
        "<plugin": "<plugin>: it is left out",
        "<joint": "<joint>: the model 'door' has movable joints: it is simulated as one fixed body",
        "https": "<uri>: https://fuel.gazebosim.org/1.0/OpenRobotics/models/Radio is on the Internet and left out: "
        "download it",
        "<zeppelin": "<zeppelin>: it is not understood, and ignored",
    }
    lines = {tag: [number for number, line in enumerate(WORLD.splitlines(), start=1) if tag in line] for tag in told}
    assert list(world.notes) == [f"{file}:{lines[tag][0]}: {text}" for tag, text in told.items()]


def model(geometry: str, static: str = "true") -> str:
    return (
        f'<sdf version="1.6"><world name="w"><model name="m"><static>{static}</static><link name="l">'
        f'<collision name="c"><geometry>\n{geometry}</geometry></collision></link></model></world></sdf>'
    )


def only(world: WorldDescription) -> WorldBody:
    (body,) = world.bodies
    return body


def test_meshes_height_maps_polylines_and_planes(package: Path) -> None:
    mesh = package / "models" / "box" / "wedge.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    (part,) = only(read(package, model("<mesh><uri>model://box/wedge.obj</uri><scale>2 1 1</scale></mesh>"))).parts
    assert isinstance(part.shape, MeshShape)
    assert (part.shape.file, part.shape.scale) == (mesh, (2, 1, 1))
    assert part.shape.mesh.bounds.tolist() == [[0, 0, 0], [2, 1, 1]]
    Image.fromarray(np.full((5, 9), 128, np.uint8)).save(package / "worlds" / "hills.png")
    (part,) = only(
        read(package, model("<heightmap><uri>hills.png</uri><size>8 4 10</size><pos>1 0 -2</pos></heightmap>"))
    ).parts
    assert isinstance(part.shape, HeightMapShape)
    assert (part.shape.size, part.shape.heights.shape, part.ground) == ((8, 4), (5, 9), True)
    assert part.pose.position == (1, 0, -2)
    corners = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
    points = "".join(f"<point>{x} {y}</point>" for x, y in corners)
    (part,) = only(read(package, model(f"<polyline>{points}<height>2</height></polyline>"))).parts
    assert isinstance(part.shape, MeshShape)
    vertices, triangles = part.shape.mesh.vertices, part.shape.mesh.triangles
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(10.0)  # normals point outwards
    (part,) = only(read(package, model("<plane><normal>1 0 0</normal><size>4 6</size></plane>"))).parts
    assert part.shape == BoxShape((4, 6, 0.1))
    assert (part.pose @ Pose3((0, 0, 0.05))).position == pytest.approx((0, 0, 0))
    assert (part.pose @ Pose3((0, 0, 1))).position[0] == pytest.approx(0.95)
    assert read(package, model("<plane><normal>0 0 1</normal><size>300000 300000</size></plane>")).bodies == ()
    floor = only(read(package, model("<box><size>5 5 0.1</size></box>")))
    assert [part.ground for part in floor.parts] == [True]


def test_what_cannot_be_read_is_refused_with_file_and_line(package: Path) -> None:
    (package / "secret.obj").write_text("v 0 0 0\n")
    loop = package / "models" / "loop"
    loop.mkdir()
    (loop / "model.sdf").write_text(
        '<sdf version="1.6"><model name="loop">\n<include><uri>model://loop</uri></include></model></sdf>'
    )
    for text, told in [
        (model("<donut><radius>1</radius></donut>"), ":2: unknown shape <donut> (known: box, cylinder"),
        (model("<box><size>1 -1 1</size></box>"), ":2: <size> 1 -1 1 of a box is not positive"),
        (model("<box><size>1 nan 1</size></box>"), ":2: <size> '1 nan 1': expected 3 numbers up to 10000"),
        (model("<sphere><radius>\n-1</radius></sphere>"), ":2: <radius> '-1' of <sphere> is not positive"),
        (model("<sphere><radius>inf</radius></sphere>"), ":2: <radius> 'inf' of <sphere> is not a number up to"),
        (model("<mesh><uri>model://box/../../secret.obj</uri></mesh>"), ":2: model://box/../../secret.obj leads out"),
        (model("<mesh/>"), ":2: <mesh> has no <uri>"),
        (model("<polyline><point>0 0</point><height>1</height></polyline>"), ":2: a polyline has 3 to 1000 corners"),
        (
            "<sdf><world name='w'>\n<include><uri>model://loop</uri></include></world></sdf>",
            "model.sdf:2: model://loop",
        ),
        ("<sdf><world name='w'>\n<include/></world></sdf>", ":2: <include> has no <uri>"),
        ('<!DOCTYPE sdf [<!ENTITY a "b">]>\n<sdf/>', ":1: the SDF declares a document type"),
        ("\n\n<robot name='r'/>", ":3: the root is <robot>, not <sdf>"),
        ("<sdf>\n<world name='w'>", ":2: the SDF is not XML"),
        ("<sdf/>", ":1: there is neither a world nor a model"),
        ("<sdf>" + "<model name='m'>" * 70 + "</model>" * 70 + "</sdf>", "at most 400,000 elements, 64 deep"),
        ("<sdf>" + "<model name='m'>" * 20 + "</model>" * 20 + "</sdf>", "models lie more than 8 deep"),
        (
            "<sdf><model name='m'>" + '<link name="l"><pose relative_to="k"/></link>'
            '<link name="k"><pose relative_to="l"/></link></model></sdf>',
            "relative to each other",
        ),
    ]:
        with pytest.raises(BadWorld) as error:
            read(package, text)
        assert told in str(error.value), error.value
        assert str(error.value).startswith(str(package))
    many = "<model name='m'><link name='l'>" + "<collision name='c'><geometry><sphere/></geometry></collision>" * 6000
    with pytest.raises(BadWorld, match="the world has 6,000 shapes, the limit is 5,000"):
        read(package, f"<sdf>{many}</link></model></sdf>")


def test_a_world_is_read_without_the_files_that_are_not_there(package: Path) -> None:
    mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    (package / "models" / "wedge.obj").write_text(mesh)
    part = '<collision name="c"><geometry>\n<mesh><uri>model://{}</uri></mesh></geometry></collision>'
    text = (
        '<sdf version="1.6"><world name="w"><model name="m"><static>1</static><link name="l">{}</link></model>\n'
        "<include><uri>model://bix</uri></include></world></sdf>"
    )
    parts = "".join(part.format(each) for each in ("box/none.stl", "far/a.stl", "wedge.obj"))
    world = read(package, text.format(parts))
    assert len(only(world).parts) == 1
    told = [each.partition(": left out: ") for each in world.missing]
    assert [(place.rpartition(":")[2], text.partition(":")[0]) for place, _, text in told] == [
        ("1", "model"),
        ("2", "there is no model 'far'"),
        ("5", "there is no model 'bix'"),
    ]
    assert "did you mean 'box'?" in world.missing[2]
    assert set(world.missing) <= set(world.notes)
    with pytest.raises(BadWorld, match="there is no model 'far'"):
        read_sdf_model('<sdf><model name="m"><link name="l">' + part.format("far/a.stl") + "</link></model></sdf>")


def test_a_world_is_read_without_a_height_map_whose_image_is_missing(package: Path) -> None:
    world = read(package, model("<heightmap><uri>hills.png</uri><size>8 4 10</size></heightmap>"))
    assert world.bodies == ()
    assert "hills.png" in world.missing[0]


def test_nested_models_may_be_relative_to_other_frames(package: Path) -> None:
    ball = '<link name="l"><collision name="c"><geometry><sphere/></geometry></collision></link>'
    text = (
        '<sdf version="1.7"><world name="w"><frame name="corner"><pose>10 0 0 0 0 0</pose></frame><model name="m">'
        '<pose relative_to="corner">1 0 0 0 0 1.5707963267948966</pose>'
        '<frame name="shelf"><pose>0 0 2 0 0 0</pose></frame>'
        f'<model name="nested"><pose relative_to="shelf">1 0 0 0 0 0</pose>{ball}</model>'
        '<include><uri>model://box</uri><pose relative_to="shelf">2 0 0 0 0 0</pose></include>'
        '<frame name="tip" attached_to="nested::l"/>'
        '<model name="far"><pose relative_to="tip">3 0 0 0 0 0</pose>'
        f"{ball}</model></model></world></sdf>"
    )
    world = read(package, text)
    assert {body.name: body.pose.position for body in world.bodies} == {
        "m::nested": pytest.approx((11, 1, 2)),
        "m::box": pytest.approx((11, 2, 2)),
        "m::far": pytest.approx((11, 3, 0)),
    }
    (note,) = world.notes
    assert note.endswith("<frame>: there is no frame 'nested::l' in this model: the pose is in the model's frame")


def test_the_declared_encoding_of_a_text_has_no_effect(package: Path) -> None:
    for encoding in ("ISO-8859-1", "utf-16"):
        text = f'<?xml version="1.0" encoding="{encoding}"?><sdf><world name="Höfe"/></sdf>'
        assert read(package, text).about == "Höfe"


def test_a_world_is_read_without_what_flew_away(package: Path) -> None:
    far = '<pose frame="">1 2 343582.7 0 0 0</pose>'
    text = (
        f'<sdf version="1.6"><world name="w">\n<model name="m">{far}<include><uri>model://box</uri></include></model>\n'
        f"<include><uri>model://box</uri>{far.replace('1 2', '1 3')}</include>\n"
        "<include><uri>model://box</uri><pose>1 2 10000 0 0 0</pose></include></world></sdf>"
    )
    world = read(package, text)
    assert [body.pose.position for body in world.bodies] == [(1.0, 2.0, 10000.0)]
    assert [note.partition(".world:")[2] for note in world.notes] == [
        "2: <pose>: a model farther away than 10000 m is left out: 1 2 343582.7 0 0 0",
        "3: <pose>: a model farther away than 10000 m is left out: 1 3 343582.7 0 0 0",
    ]
    for bad in ("1 2 inf 0 0 0", "1 2 nan 0 0 0", "1 2 10000", "1 2 x 0 0 0"):
        with pytest.raises(BadWorld, match="expected 6 numbers up to 10000"):
            read(package, text.replace("1 2 10000 0 0 0", bad))


def test_models_are_where_a_saved_world_moved_them(package: Path) -> None:
    crate = (
        '<model name="crate"><pose>4 5 0.5 0 0 0</pose><link name="l"><pose>1 0 0 0 0 0</pose><collision name="c">'
        "<geometry><sphere/></geometry></collision></link></model>"
    )
    include = "<include><uri>model://box</uri><name>lid</name><pose>1 1 1 0 0 0</pose></include>"

    def saved(crate_at: str, *other: str) -> WorldDescription:
        moved = f'<model name="crate"><pose frame="">{crate_at}</pose><link name="l"><pose>9 9 9 0 0 0</pose></link>'
        later = '<state world_name="w"><model name="crate"><pose>0 0 0 0 0 0</pose></model></state>'
        state = f'<state world_name="w"><sim_time>9 0</sim_time>{moved}</model>{"".join(other)}</state>{later}'
        return read(package, f'<sdf version="1.6"><world name="w">{crate}{include}{state}</world></sdf>')

    def places(world: WorldDescription) -> dict[str, object]:
        return {body.name: pytest.approx(body.pose.position) for body in world.bodies}

    world = saved("2 8 0.5 0 0 1.5707963267948966", '<model name="lid"><pose>3 3 3 0 0 0</pose></model>')
    assert places(world) == {"crate": (2, 9, 0.5), "lid": (3, 3, 3)}
    assert world.notes == ()
    for unusable in ("nan 0 0 0 0 0", "2 8", ""):
        assert places(saved(unusable)) == {"crate": (5, 5, 0.5), "lid": (1, 1, 1)}, "those of the models"
    world = saved("2 8 -34000 0 0 0")
    assert places(world) == {"lid": (1, 1, 1)}
    assert "a model farther away than 10000 m is left out: 2 8 -34000" in world.notes[0]


def test_a_model_fixed_to_the_world_by_a_joint_is_fixed(package: Path) -> None:
    shelf = (
        '<model name="shelf"><link name="l"><collision name="c"><geometry><sphere/></geometry></collision></link>'
        '<joint name="j" type="fixed"><parent>{}</parent><child>{}</child></joint></model>'
    )
    for ends, kind in ((("world", "l"), "fixed"), (("l", "world"), "fixed"), (("l", "l"), "movable")):
        world = read(package, f'<sdf version="1.6"><world name="w">{shelf.format(*ends)}</world></sdf>')
        assert only(world).kind == kind


def test_the_name_of_a_model_may_follow_three_slashes(package: Path) -> None:
    (package / "models" / "box" / "wedge.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    )
    mesh = "<mesh><uri>model:///{}/wedge.obj</uri></mesh>"
    assert isinstance(only(read(package, model(mesh.format("box")))).parts[0].shape, MeshShape)
    assert "'nobox'" in read(package, model(mesh.format("nobox"))).missing[0]


def test_no_mass_and_no_extent_cost_no_world(package: Path) -> None:
    text = WORLD.replace("<mass>2.5</mass>", "<mass>0</mass>").replace("<ixx>0.1<", "<ixx>-nan<")
    text = text.replace(
        "<sphere><radius>0.3</radius></sphere>", "<mesh><scale>1 0 0</scale><uri>model://box/flat.dae</uri></mesh>"
    )
    world = read(package, text)
    crate = next(body for body in world.bodies if body.name == "crate")
    assert crate.moments is None
    assert (crate.mass, [type(part.shape) for part in crate.parts]) == (1.0, [CylinderShape])
    told = {note.partition(": ")[2] for note in world.notes}
    assert {"<inertial>: a mass of 0 kg is replaced by 1 kg", "<mesh>: a mesh that is scaled by 0 is left out"} <= told


def test_a_file_is_found_from_the_folder_of_the_package(package: Path) -> None:
    (package / "models" / "box" / "wedge.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    )
    mesh = "<mesh><uri>file://models/box/{}.obj</uri></mesh>"
    (package / "models" / "box" / "model-1_6.sdf").write_text(
        BOX.replace("<box><size>0.5 0.5 0.5</size></box>", mesh.format("wedge"))
    )
    include = '<sdf version="1.6"><world name="w"><include><uri>model://box</uri></include></world></sdf>'
    world = read(package, include)
    assert isinstance(only(world).parts[0].shape, MeshShape)
    assert world.notes == ()
    assert "no.obj" in read(package, model(mesh.format("no"))).missing[0]


def test_an_ampersand_may_stand_by_itself(package: Path) -> None:
    config = package / "models" / "box" / "model.config"
    described = "<description>lid, door & car &amp; &#38; &c</description>"
    config.write_text(config.read_text().replace("</name>", f"</name>{described}"))
    world = read(package, WORLD.replace('"yard"', '"yard & garden"'))
    assert (world.about, len(world.bodies)) == ("yard & garden", 9)
    config.write_text(config.read_text().replace("& car", "R&D; car"))
    with pytest.raises(BadWorld, match=r"model\.config:1: the SDF is not XML: undefined entity"):
        read(package, WORLD)


def test_a_world_of_gazebo_may_have_any_name(tmp_path: Path) -> None:
    for name in ("yard", "yard.xml"):
        (tmp_path / name).write_text(WORLD)
        assert read_world(str(tmp_path / name)).bodies == read_world(str(tmp_path / "yard")).bodies
    (tmp_path / "notes").write_text("a yard")
    with pytest.raises(BadWorld, match="not one without ending"):
        read_world(str(tmp_path / "notes"))
