"""Sample robots in the style of published ones: a package with URDF, xacro and meshes."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

INERTIAL = '<inertial><mass value="{mass}"/><inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>'


def inertial(mass: float = 1.0, moment: float = 0.01) -> str:
    """Return a link's ``<inertial>``; mass [kg], moment [kg m2]."""
    return INERTIAL.format(mass=mass, i=moment)


def link(name: str, *content: str) -> str:
    """Return a link on a line of its own."""
    return f'<link name="{name}">{"".join(content)}</link>\n'


def joint(name: str, kind: str, parent: str, child: str, *content: str) -> str:
    """Return a joint on a line of its own."""
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{"".join(content)}</joint>\n'


def shape(tag: str, geometry: str, xyz: str = "0 0 0", rpy: str = "0 0 0") -> str:
    """Return a ``<collision>`` or ``<visual>``."""
    return f'<{tag}><origin xyz="{xyz}" rpy="{rpy}"/><geometry>{geometry}</geometry></{tag}>'


def robot(*content: str, name: str = "sample") -> str:
    """Return the URDF."""
    return f'<?xml version="1.0"?>\n<robot name="{name}">\n{"".join(content)}</robot>\n'


INERTIAL_OF_BASE = (
    '<inertial><origin xyz="0 0 0.08"/><mass value="3"/>'
    '<inertia ixx="0.011" iyy="0.024" izz="0.033" ixy="0" ixz="0" iyz="0"/></inertial>'
)
ACROSS = '<axis xyz="0 1 0"/>'


def car(front: Sequence[float], limit: str = '<limit lower="-0.5" upper="0.5" effort="20" velocity="3"/>') -> str:
    """Return a car with a driven rear axle and a wheel on a steering joint at each of the ``front`` y offsets [m]."""
    wheel = inertial(0.5, 1e-3), shape("collision", '<cylinder radius="0.1" length="0.05"/>', rpy="1.5707963 0 0")
    parts = [link("base_link", INERTIAL_OF_BASE, shape("collision", '<box size="0.5 0.2 0.1"/>', "0.2 0 0.15"))]
    for side, y in (("left", 0.2), ("right", -0.2)):
        origin = f'<origin xyz="0 {y} 0.1"/>'
        parts += [joint(f"rear_{side}", "continuous", "base_link", f"{side}_wheel", origin, ACROSS)]
        parts += [link(f"{side}_wheel", *wheel)]
    for number, y in enumerate(front):
        # The second one has a reversed axis, as some are mounted.
        axis = f'<axis xyz="0 0 {-1 if number else 1}"/>'
        kingpin, rim = f"kingpin_{number}", f"front_wheel_{number}"
        origin = f'<origin xyz="0.4 {y} 0.1"/>'
        parts += [joint(f"steer_{number}", "revolute", "base_link", kingpin, origin, axis, limit)]
        parts += [link(kingpin, inertial(0.2, 1e-3)), joint(f"front_{number}", "continuous", kingpin, rim, ACROSS)]
        parts += [link(rim, *wheel)]
    return robot(*parts, name="car")


def write(path: Path, text: str) -> Path:
    """Write a file with its folders; return its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def write_package(folder: Path, name: str) -> Path:
    """Write a package, a folder with a ``package.xml``; return it."""
    write(folder / "package.xml", f"<package><name>{name}</name></package>")
    return folder


CUBE = [(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)]
"""Corners of a box from the origin to (1, 2, 3) [m]."""
CUBE_SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
CUBE_TRIANGLES = [each for a, b, c, d in CUBE_SIDES for each in ((a, b, c), (a, c, d))]


def write_meshes(folder: Path) -> dict[str, Path]:
    """Write the box of ``CUBE`` in all formats; return the files by format."""
    folder.mkdir(parents=True, exist_ok=True)
    files = {
        "stl": folder / "cube.stl",
        "ascii": folder / "ascii.STL",
        "obj": folder / "cube.obj",
        "dae": folder / "cube.dae",
    }
    files["stl"].write_bytes(binary_stl([[CUBE[n] for n in each] for each in CUBE_TRIANGLES]))
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*CUBE[n]) for n in each)
        + "endloop\nendfacet\n"
        for each in CUBE_TRIANGLES
    )
    files["ascii"].write_text(f"solid cube\n{facets}endsolid cube\n")
    corners = "".join("v {} {} {}\n".format(*each) for each in CUBE)
    sides = "".join(f"f {' '.join(str(n + 1) for n in each)}\n" for each in CUBE_SIDES)
    files["obj"].write_text(f"mtllib missing.mtl\no cube\n{corners}usemtl red\n{sides}")
    files["dae"].write_text(dae_cube())
    return files


def binary_stl(triangles: Sequence[Sequence[tuple[float, float, float]]]) -> bytes:
    """Return a binary STL."""
    rows = b"".join(
        struct.pack("<12fH", 0, 0, 0, *(part for corner in each for part in corner), 0) for each in triangles
    )
    return bytes(80) + struct.pack("<I", len(triangles)) + rows


def dae_cube() -> str:
    """Return the box in centimetres, with its node moved by -100 along x: from (-1, 0, 0) to (0, 2, 3) [m]."""
    numbers = " ".join(f"{100 * part}" for corner in CUBE for part in corner)
    indices = " ".join(str(n) for each in CUBE_SIDES for n in each)
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="24">{numbers}</float_array><technique_common>
<accessor source="#a" count="8" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="6"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4 4 4 4 4 4</vcount><p>{indices}</p>
</polylist></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><translate>-100 0 0</translate><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
