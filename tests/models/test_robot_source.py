"""Resolving a robot's path to files that every process can read; mistakes are reported with file and line."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree

import pytest

from models import MODELS, UnknownModel, display_name, physics_urdf_path, urdf_path, viewer_urdf_path
from models.inferred import read_wheel
from models.mesh import read_mesh
from models.model import read_model
from models.packages import FileAccess, FileNotAllowed
from models.robot_facts import read_facts
from models.robot_source import resolve_robot, resolve_urdf_text
from models.shapes import read_shapes
from models.urdf import BadUrdf, parse_urdf, parse_xml, read_robot
from models.xacro_file import BadXacro, expand_xacro
from services.runtime.errors import BadInput
from tests.models.sample_robots import inertial, joint, link, robot, shape, write, write_meshes, write_package

WHEEL = shape("collision", '<cylinder radius="0.05" length="0.02"/>', rpy="1.5707963 0 0")


def rolling(*content: str) -> str:
    """Return a base on two wheels whose root is at the height of their axle."""
    return robot(
        link("base_link", inertial(), shape("collision", '<box size="0.3 0.2 0.06"/>'), *content),
        *(
            link(f"{side}_wheel", inertial(0.1, 1e-4), WHEEL)
            + joint(
                f"{side}_joint",
                "continuous",
                "base_link",
                f"{side}_wheel",
                f'<origin xyz="0 {y} 0"/><axis xyz="0 1 0"/>',
            )
            for side, y in (("left", 0.12), ("right", -0.12))
        ),
        name="rolling robot",
    )


def mesh(said: str, scale: str = "1 1 1") -> str:
    """Return a ``<collision>`` with a mesh."""
    return shape("collision", f'<mesh filename="{said}" scale="{scale}"/>')


def test_a_urdf_anywhere_becomes_a_model(tmp_path: Path) -> None:
    write(tmp_path / "my robots" / "rover.urdf", rolling())
    found = resolve_robot("my robots/rover.urdf", tmp_path)
    assert (found.name, display_name(found.model)) == ("rover", "rover")
    assert not (found.urdf.parent / "model.toml").is_file()
    assert urdf_path(found.model) == found.urdf
    assert found.urdf.read_text() == rolling(), "what is published is the user's text, line by line"
    assert resolve_robot(found.model, Path("/")) == found, "its own name leads back to it"
    assert resolve_robot(Path(found.model).name, Path("/")) == found
    model = read_model(found.model)
    assert (model.about, model.base_frame, model.fixed_base) == ("rolling robot", "base_link", False)
    assert model.wheels is not None, "they are found by their shapes"
    assert model.radius == pytest.approx(0.18, abs=1e-2)
    assert read_facts(found.model).lowest == pytest.approx(-0.05, abs=1e-4)
    assert "wheels simulated as spheres of their radius: left_wheel, right_wheel" in found.notes
    radii = {each.name: each.radius for each in parse_urdf(physics_urdf_path(found.model).read_text()).links}
    assert radii["left_wheel"] == pytest.approx(0.05, rel=1e-3)
    assert resolve_robot("burger", tmp_path).urdf == urdf_path("burger")


def test_a_file_that_changed_is_another_robot(tmp_path: Path) -> None:
    meshes = write_meshes(tmp_path / "meshes")
    path = write(tmp_path / "r.urdf", rolling(mesh("meshes/cube.stl")))
    first = resolve_robot(str(path), Path("/"))
    assert resolve_robot(str(path), Path("/")).model == first.model
    path.write_text(rolling(mesh("meshes/cube.stl", "1 1 2")))
    second = resolve_robot(str(path), Path("/"))
    meshes["stl"].write_bytes((tmp_path / "meshes" / "ascii.STL").read_bytes().replace(b"3", b"4"))
    third = resolve_robot(str(path), Path("/"))
    assert len({first.model, second.model, third.model}) == 3
    assert [read_facts(each.model).highest for each in (first, second, third)] == [3, 6, 8]


def test_meshes_are_found_where_ros_would_find_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = write_package(tmp_path / "src" / "a folder", "my_description")
    write_meshes(own / "meshes")
    write_meshes(tmp_path / "src" / "sibling" / "meshes")
    write_meshes(tmp_path / "install" / "share" / "installed" / "meshes")
    write_meshes(write_package(tmp_path / "ros" / "deep" / "er", "crawled") / "meshes")
    write_meshes(tmp_path / "given" / "named" / "meshes")
    write_meshes(write_package(tmp_path / "itself", "package_itself") / "meshes")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path / 'install'}")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    said = [
        "package://my_description/meshes/cube.stl",
        "model://sibling/meshes/cube.obj",
        "package://installed/meshes/cube.dae",
        "package://crawled/meshes/ascii.STL",
        "package://named/meshes/cube.stl",
        "package://package_itself/meshes/cube.stl",
        f"file://{own}/meshes/cube.stl",
        f"{own}/meshes/cube.stl",
        "../meshes/cube.stl",
    ]
    write(own / "urdf" / "r.urdf", rolling(*map(mesh, said)))
    given = [tmp_path / "given", tmp_path / "itself"]
    found = resolve_robot(str(own / "urdf" / "r.urdf"), Path("/"), given)
    text = found.urdf.read_text()
    assert "package://" not in text
    assert "model://" not in text
    assert text.count('filename="file:///') == len(said)
    physics = physics_urdf_path(found.model).read_text()
    assert physics.count("<mesh ") == len(said)
    assert viewer_urdf_path(found.model).read_text().count("<visual>") == 3 + len(said), "what collides is shown"
    with pytest.raises(BadUrdf, match=r"r.urdf:3: .*there is no package 'named'"):
        resolve_robot(str(own / "urdf" / "r.urdf"), Path("/"))


def test_a_package_holds_its_files(tmp_path: Path) -> None:
    package = write_package(tmp_path / "ws" / "pkg", "pkg")
    write_meshes(tmp_path / "outside")
    copy = write_package(tmp_path / "source" / "copy of it", "pkg")
    write_meshes(copy)
    (package / "meshes").mkdir()
    (package / "meshes" / "out.stl").symlink_to(tmp_path / "outside" / "cube.stl")
    (package / "meshes" / "same.stl").symlink_to(copy / "cube.stl")
    path = tmp_path / "ws" / "pkg" / "r.urdf"
    for said in ("package://pkg/../../outside/cube.stl", "package://pkg/meshes/out.stl"):
        write(path, rolling(mesh(said)))
        with pytest.raises(BadUrdf, match=r"r.urdf:3: .*leads out of the package pkg"):
            resolve_robot(str(path), Path("/"))
    write(path, rolling(mesh("package://pkg/meshes/same.stl")))
    assert resolve_robot(str(path), Path("/")).name == "r", "a workspace of links is its package"


def test_requests_read_in_their_folders_alone_and_run_nothing(tmp_path: Path) -> None:
    inside, outside = tmp_path / "fleet", tmp_path / "outside"
    write_meshes(inside / "meshes")
    write_meshes(outside)
    access = FileAccess((inside,), run_xacro=False)
    write(inside / "r.urdf", rolling(mesh("meshes/cube.stl")))
    assert resolve_robot("r.urdf", inside, access=access).name == "r"
    write(outside / "r.urdf", rolling())
    (inside / "link.urdf").symlink_to(outside / "r.urdf")
    (inside / "meshes" / "link.stl").symlink_to(outside / "cube.stl")
    for model in ("../outside/r.urdf", str(outside / "r.urdf"), "link.urdf", "/etc/passwd", "..", "/dev/zero"):
        with pytest.raises(FileNotAllowed, match="lies outside the folders"):
            resolve_robot(model, inside, access=access)
    (inside / "folder").mkdir()
    (inside / "folder" / "robot.urdf").symlink_to(outside / "r.urdf")
    with pytest.raises(FileNotAllowed, match=r"robot\.urdf lies outside the folders"):
        resolve_robot("./folder", inside, access=access)
    (inside / "folder" / "robot.urdf").unlink()
    write(inside / "folder" / "robot.urdf", rolling())
    (inside / "folder" / "model.toml").symlink_to(outside / "r.urdf")
    with pytest.raises(FileNotAllowed, match=r"model\.toml lies outside the folders"):
        resolve_robot("./folder", inside, access=access)
    for said in ("meshes/link.stl", "../outside/cube.stl", f"file://{outside}/cube.stl"):
        write(inside / "r.urdf", rolling(mesh(said)))
        with pytest.raises(BadUrdf, match=r"r.urdf:3: .*lies outside the folders"):
            resolve_robot("r.urdf", inside, access=access)
    xacro = write(
        inside / "x.xacro", rolling().replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    )
    with pytest.raises(BadInput, match="a xacro is code"):
        resolve_robot("x.xacro", inside, access=access)
    for text, told in (
        (xacro.read_text().replace("</robot>", "<xacro:x/></robot>"), "is a xacro, which is code"),
        (rolling(mesh("cube.stl")), "the URDF:3: .*by package:// or file://"),
        (rolling(mesh(f"file://{outside}/cube.stl")), "the URDF:3: .*lies outside"),
    ):
        with pytest.raises(BadInput, match=told):
            resolve_urdf_text(text, access=access)
    sent = resolve_urdf_text(rolling(mesh(f"file://{inside}/meshes/cube.stl")), access=access)
    assert sent.name == "rolling_robot"


@pytest.mark.process
def test_a_xacro_of_older_releases_needs_no_prefix(tmp_path: Path) -> None:
    (tmp_path / "wheels.xacro").write_text(
        '<robot xmlns:xacro="http://ros.org/wiki/xacro"><property name="width" value="0.2"/>'
        '<macro name="wheel" params="side *place"><link name="${side}"><visual><insert_block name="place"/>'
        '<geometry><cylinder radius="0.1" length="${width / 2}"/></geometry></visual></link></macro>'
        '<xacro:macro name="cylinder" params="side"><link name="${side}"/></xacro:macro></robot>'
    )
    (tmp_path / "cart.xacro").write_text(
        '<robot name="cart" xmlns:xacro="http://ros.org/wiki/xacro"><include filename="wheels.xacro"/>'
        '<wheel side="left"><origin xyz="0 1 0"/></wheel><if value="0"><wheel side="none"/></if></robot>'
    )
    urdf = expand_xacro(tmp_path / "cart.xacro", {})
    assert [each.get("name") for each in ElementTree.fromstring(urdf).iter("link")] == ["left"]
    assert ('<origin xyz="0 1 0"/>' in urdf, 'length="0.1"' in urdf) == (True, True)


@pytest.mark.process
def test_a_xacro_is_expanded_without_ros(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = write_package(tmp_path / "pkg", "my_description")
    head = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    write(package / "config" / "size.yaml", "radius: 0.05")
    write(
        package / "urdf" / "wheel.xacro",
        f'{head}<xacro:macro name="wheel" params="name y">\n'
        '<link name="$(arg prefix)${name}"><collision><geometry><sphere radius="${size[\'radius\']}"/></geometry>'
        "</collision>"
        f'{inertial()}</link>\n<joint name="${{name}}_joint" type="continuous"><parent link="base"/>'
        '<child link="$(arg prefix)${name}"/><origin xyz="0 ${y * 2} 0"/></joint></xacro:macro></robot>',
    )
    path = write(
        package / "urdf" / "r.urdf.xacro",
        f'{head}\n<xacro:arg name="prefix" default=""/>\n'
        '<xacro:property name="size" value="${xacro.load_yaml(\'$(find my_description)/config/size.yaml\')}"/>\n'
        '<xacro:include filename="$(find my_description)/urdf/wheel.xacro"/>\n<link name="base"/>\n'
        '<xacro:wheel name="left" y="0.1"/>\n<xacro:if value="$(env WITH_RIGHT)"><xacro:wheel name="right" y="-0.1"/>'
        "</xacro:if>\n</robot>",
    )
    monkeypatch.setenv("WITH_RIGHT", "1")
    found = resolve_robot(str(path), Path("/"), xacro_args={"prefix": "front_"})
    assert [each.name for each in read_robot(found.model).links] == ["base", "front_left", "front_right"]
    assert [each.xyz[1] for each in read_robot(found.model).joints] == [0.2, -0.2]
    assert read_robot(found.model).links[1].radius == 0.05
    wrong = {
        '\n<xacro:wheel name="a" y="b"/>': r"wrong.xacro \(expanded\):\d+: joint 'a_joint': .*'0 bb 0' is not",
        '\n\n<link name="$(arg what)"/>': "wrong.xacro:3: the argument what is not set: set it with xacro_args",
        "\n<xacro:nothing/>": "wrong.xacro:2: unknown macro name: xacro:nothing",
        '<link name="${1 +}"/>': "wrong.xacro:1: ",
        "<a></b>": "wrong.xacro:1: this is not XML",
        '<xacro:include filename="missing.xacro"/>': "wrong.xacro:1: .*No such file",
        '<xacro:include filename="$(find my_descriptoin)/a"/>': "'my_descriptoin'; did you mean 'my_description'",
        '<xacro:include filename="wrong.xacro"/>': "includes itself",
        '<link name="${[0] * 10**10}"/>': "wrong.xacro:1: it needs more memory",
        "<link name='a'/><link name='a'/>": r"wrong.xacro \(expanded\):\d+: the link 'a' occurs twice",
    }
    include = '<xacro:include filename="wheel.xacro"/>' + '<xacro:property name="size" value="${dict(radius=1)}"/>'
    for text, told in wrong.items():
        write(package / "urdf" / "wrong.xacro", f"{head}<xacro:arg name='prefix' default=''/>{include}{text}</robot>")
        with pytest.raises(BadInput, match=told):
            resolve_robot(str(package / "urdf" / "wrong.xacro"), Path("/"))
    write(package / "urdf" / "endless.xacro", f'{head}<link name="${{9**9**9}}"/></robot>')
    with pytest.raises(BadXacro, match=r"not expanded within 1 s of processor time: does a macro call itself"):
        expand_xacro(package / "urdf" / "endless.xacro", {}, max_time=1)
    with pytest.raises(BadXacro, match=r"not expanded within 0.1 s: what does it wait for"):
        expand_xacro(package / "urdf" / "endless.xacro", {}, max_wait=0.1)


def test_bad_robots_are_refused_with_file_and_line(tmp_path: Path) -> None:
    base = link("base", inertial())
    revolute = joint("j", "revolute", "base", "arm", '<limit lower="1" upper="-1" effort="1" velocity="1"/>')
    fixed = joint("k", "fixed", "arm", "base")
    cases = {
        r"r.urdf:2: the URDF declares a document type": '<?xml version="1.0"?>\n<!DOCTYPE r [<!ENTITY a "a">]><robot/>',
        r"r.urdf:3: link 'base': collision: the mesh gone.stl is missing: there is no .*gone.stl": robot(
            link("base", inertial(), mesh("gone.stl"))
        ),
        r"r.urdf:5: joint 'j': its lower limit 1 lies above the upper one -1": robot(base, link("arm"), revolute),
        r"r.urdf:\d: the links are in a loop through": robot(
            base, link("arm"), joint("j", "fixed", "base", "arm"), fixed
        ),
        r"r.urdf:4: the links do not form a tree: 'base', 'arm' have no parent": robot(base, link("arm")),
        r"r.urdf:3: link 'base': value='heavy' is not a number": robot(
            link("base", inertial()).replace("1.0", "heavy")
        ),
        r"r.urdf:3: link 'base': value='nan' is not a number": robot(link("base", inertial(mass=float("nan")))),
        r"r.urdf: link 'base': its mass or inertia exceeds 1e\+06": robot(link("base", inertial(mass=1e300))),
        r"r.urdf:3: .*box size='1e400 1 1' exceeds": robot(link("base", shape("collision", '<box size="1e400 1 1"/>'))),
        r"r.urdf:3: .*sphere -1: a length is below 0": robot(link("base", shape("visual", '<sphere radius="-1"/>'))),
        r"r.urdf:3: .*a factor is 0": robot(link("base", mesh("gone.stl", "0 1 1"))),
        r"r.urdf:4: joint 'j': there is no link 'bse'; did you mean 'base'": robot(
            base, joint("j", "fixed", "bse", "base")
        ),
        r"r.urdf:4: the URDF is not XML: mismatched tag": robot(base).replace("</robot>", "</robt>"),
        r"r.urdf:1: the URDF's root is <sdf>": "<sdf/>",
    }
    path = tmp_path / "r.urdf"
    for told, text in cases.items():
        path.write_text(text)
        with pytest.raises(BadInput, match=told):
            resolve_robot(str(path), Path("/"))
    os.mkfifo(tmp_path / "pipe.urdf")
    with (tmp_path / "long.urdf").open("wb") as long:
        long.truncate(100_000_000)
    (tmp_path / "empty").mkdir()
    for model, told in (
        ("pipe.urdf", "a pipe, socket or device, not a URDF"),
        ("long.urdf", "has 100000000 bytes, the limit of a URDF is"),
        ("./empty", "contains no robot"),
        ("empty", "by its path, e.g. ./empty"),
        ("nothing.urdf", r"there is no file .*nothing.urdf \(in its folder: empty, long.urdf"),
        ("burgre", "unknown model 'burgre'; did you mean 'burger'.*give a robot of your own by its path"),
        ("gone-0123456789abcdef", "unknown model"),
    ):
        with pytest.raises(BadInput, match=told):
            resolve_robot(model, tmp_path)
    with pytest.raises(UnknownModel, match="no longer in the cache: start the fleet"):
        urdf_path("/tmp/gone-0123456789abcdef")


def test_what_urdfs_in_the_wild_lack_is_assumed_and_told(tmp_path: Path) -> None:
    text = robot(
        link("base_footprint"),
        link("base/link with spaces", inertial(5), shape("visual", '<box size="0.4 0.3 0.2"/>')),
        joint("base", "fixed", "base_footprint", "base/link with spaces", '<origin xyz="0 0 0.1"/>'),
        link("no_inertia", inertial(1, 0.0), shape("collision", '<box size="1 1 1"/>')),
        joint("a", "continuous", "base_footprint", "no_inertia"),
        link("negative", inertial(1, -1.0)),
        joint("b", "prismatic", "base_footprint", "negative", '<limit lower="0" upper="1"/>'),
        link("products", inertial().replace('ixy="0"', 'ixy="0.5"')),
        joint("c", "revolute", "base_footprint", "products", '<limit lower="0" upper="1"/><mimic joint="b"/>'),
        link("shape_only", shape("collision", '<box size="0.1 0.1 0.1"/>')),
        joint("d", "floating", "base_footprint", "shape_only"),
        link("weightless", shape("collision", '<sphere radius="0.1"/>'), shape("collision", "<cone/>")),
        joint("e", "continuous", "base_footprint", "weightless"),
        "<transmission name='t'/><gazebo reference='base'><mu1>1</mu1></gazebo><!-- a comment -->",
        '<link xmlns="x" name="last"/>',
        joint("f", "planar", "base_footprint", "last"),
    )
    path = tmp_path / "WILD.URDF"
    path.write_bytes(
        text.replace('"1.0"?', '"1.0" encoding="ISO-8859-1"?').replace("comment", "Prüfung").encode("latin-1")
    )
    found = resolve_robot(str(path), Path("/"))
    told = "\n".join(found.notes)
    for each in (
        "links without mass, which is estimated from their shapes at 200 kg/m3: weightless 1.6 kg",
        "with an impossible inertia, which is replaced by that of their bounding box: no_inertia, negative",
        "with impossible products of inertia, which are set to 0: products",
        "floating and planar joints, which are fixed here: d, f",
        "joints that mimic others, which move freely here as in Gazebo: c",
        f"{path}: line 14: link 'weightless': collision is a 'cone', which is not a shape of a URDF: it is left out",
    ):
        assert each in told
    inertias = {each.name: each.inertia for each in parse_urdf(physics_urdf_path(found.model).read_text()).links}
    assert inertias["no_inertia"].tensor[:3] == pytest.approx((1 / 6,) * 3), "m (y^2 + z^2) / 12"
    assert all(each.mass > 0 and min(each.tensor[:3]) > 0 for each in inertias.values())
    assert sum(each.mass for each in inertias.values()) == pytest.approx(5 + 1 + 1 + 1 + 1.6, abs=1e-2)
    assert "Prüfung" in found.urdf.read_text()


def test_a_fixed_suspension_keeps_its_name(tmp_path: Path) -> None:
    base, rest = link("base_link", inertial()), ""
    for side, y in (("left", 0.12), ("right", -0.12)):
        limit = '<limit lower="0" upper="0.03" effort="0" velocity="0"/>'
        rest += (
            joint(f"{side}_prismatic", "prismatic", "base_link", side, f'<origin xyz="0 {y} 0"/>', limit)
            + link(side, inertial())
            + joint(f"{side}_joint", "continuous", side, f"{side}_wheel", '<axis xyz="0 1 0"/>')
            + link(f"{side}_wheel", inertial(), WHEEL)
        )
    found = resolve_robot(str(write(tmp_path / "sprung.urdf", robot(base, rest))), Path("/"))
    kinds = {each.name: each.kind for each in read_robot(found.model).joints}
    assert {each: kinds[each] for each in ("left_prismatic", "right_prismatic")} == {
        "left_prismatic": "fixed",
        "right_prismatic": "fixed",
    }


@pytest.mark.slow
def test_a_folder_with_a_model_file_has_its_figures(tmp_path: Path) -> None:
    folder = tmp_path / "rover"
    write(folder / "robot.urdf", rolling())
    figures = (
        'about = "mine"\nbase_frame = "base_link"\nradius = 0.2\nodometry = "encoder"\nodometry_rate = 20.0\n\n'
        '[wheels]\nleft_joint = "left_joint"\nright_joint = "right_joint"\nmax_linear = 1.0\nmax_angular = 2.0\n'
        "acceleration = 1.0\nbrake = 1.0\ntorque = 2.0\n"
    )
    write(folder / "model.toml", figures)
    found = resolve_robot("./rover", tmp_path)
    wheels = read_model(found.model).wheels
    assert found.name == "rover"
    assert wheels is not None
    assert (wheels.separation, wheels.radius) == pytest.approx((0.24, 0.05))
    for wrong, told in (
        (figures.replace("torque = 2.0", "torque = -1"), r"rover/model.toml:14: .*wheels.torque"),
        (figures.replace("brake", "brak"), r"rover/model.toml:13: .*unknown field `brak`"),
        (figures.replace('"left_joint"', '"left"'), r"rover/model.toml: there is no wheel joint 'left'"),
        (
            figures.replace('"base_link"', '"base"'),
            r"rover/model.toml:2: base_frame: unknown link 'base'; did you mean",
        ),
        ("about = ", r"rover/model.toml:1: "),
        (figures.replace("[wheels]", "[[wheels]]"), r"rover/model.toml:7: Expected `object"),
        (figures.replace('"left_joint"', '["left_joint"]'), r"rover/model.toml:8: Expected `str`, got `array`"),
        (figures[: figures.index("[wheels]")] + "wheels = 3\n", r"rover/model.toml:7: Expected `object"),
    ):
        write(folder / "model.toml", wrong)
        with pytest.raises(BadInput, match=told):
            resolve_robot("./rover", tmp_path)


def test_names_here_stay_what_they_are() -> None:
    assert [display_name(each) for each in MODELS] == list(MODELS)
    assert physics_urdf_path("burger") == viewer_urdf_path("burger") == urdf_path("burger")


def test_a_wheel_is_what_is_largest_of_what_a_joint_turns() -> None:
    """A tyre fixed to a hub with an offset and a rotation: the joint turns about y, which is the tyre's x axis."""
    tyre = shape("collision", '<cylinder radius="0.1" length="0.04"/>', xyz="0 0.02 0", rpy="0 1.5707963267948966 0")
    text = robot(
        link("base_link", inertial()),
        link("hub", inertial(), shape("collision", '<sphere radius="0.03"/>')),
        link("tyre", inertial(), tyre),
        link("cap", inertial(), shape("visual", '<sphere radius="0.3"/>')),
        joint("axle", "continuous", "base_link", "hub", '<origin xyz="1 2 0.1"/><axis xyz="0 1 0"/>'),
        joint("bolt", "fixed", "hub", "tyre", '<origin xyz="0.02 0.05 0" rpy="0 0 1.5707963267948966"/>'),
        joint("glue", "fixed", "tyre", "cap"),
    )
    shapes = read_shapes(parse_xml(text), lambda file: read_mesh(Path(file)))
    description = parse_urdf(text)
    wheel = read_wheel(description, shapes, description.joints[0])
    assert (wheel.joint, wheel.link) == ("axle", "tyre")
    assert (wheel.radius, wheel.width) == pytest.approx((0.1, 0.04))
    assert wheel.centre == pytest.approx((0.0, 0.02, 0.0))
    assert wheel.place == pytest.approx((1.0, 2.05, 0.1))
    assert wheel.axle == pytest.approx((1.0, 0.0, 0.0))
    assert wheel.direction == pytest.approx((0.0, 1.0, 0.0))
