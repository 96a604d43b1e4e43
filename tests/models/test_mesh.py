"""Meshes of all formats give the same shape; invalid or too large files are rejected before decoding."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from models.mesh import MAX_BYTES, BadMesh, hull_points, read_colours, read_mesh, write_glb
from tests.models.sample_robots import dae_cube, write_meshes


def test_all_formats_give_the_same_box(tmp_path: Path) -> None:
    for kind, file in write_meshes(tmp_path).items():
        mesh = read_mesh(file)
        left = -1.0 if kind == "dae" else 0.0
        assert mesh.bounds.tolist() == [[left, 0, 0], [left + 1, 2, 3]], kind
        assert len(mesh.triangles) == 12, kind
        assert len(hull_points(mesh)) == 8, kind
        corners = mesh.vertices[mesh.triangles]
        volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
        assert abs(volume) == pytest.approx(6.0), kind
        mirrored = mesh.scaled(-2, 1, 1)
        corners = mirrored.vertices[mirrored.triangles]
        turned = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
        assert turned == pytest.approx(2 * volume), f"{kind}: a mirror turns no surface inside out"


def test_a_hull_reaches_as_far_as_its_mesh(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    ball = random.normal(size=(20_000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    rows = "".join(f"v {x} {y} {z}\n" for x, y, z in ball.tolist())
    faces = "".join(f"f {n + 1} {n + 2} {n + 3}\n" for n in range(0, len(ball) - 2, 3))
    (tmp_path / "ball.obj").write_text(rows + faces)
    points = hull_points(read_mesh(tmp_path / "ball.obj"))
    assert len(points) <= 256
    for direction in random.normal(size=(50, 3)):
        direction /= np.linalg.norm(direction)
        assert (points @ direction).max() > 0.98


def test_what_is_no_mesh_is_refused(tmp_path: Path) -> None:
    def file(name: str, content: bytes) -> Path:
        (tmp_path / name).write_bytes(content)
        return tmp_path / name

    stl = write_meshes(tmp_path / "good")["stl"].read_bytes()
    bomb = b'<!DOCTYPE c [<!ENTITY a "aaaa">]><COLLADA/>'
    os.mkfifo(tmp_path / "pipe.stl")
    with (tmp_path / "long.stl").open("wb") as long:
        long.truncate(MAX_BYTES + 1)
    million = b"solid x\n" + b"facet normal 0 0 1\n" * 600_000
    cases = {
        "2,000,000 triangles, the limit is 500,000": file("huge.stl", bytes(80) + struct.pack("<I", 2_000_000) + b"x"),
        "600,000 triangles": file("ascii.stl", million),
        "500,001 triangles": file("many.obj", b"v 0 0 0\n" + b"f 1 1 1\n" * 500_001),
        "9,999,999 triangles": file("many.dae", dae_cube().replace('count="6"', 'count="9999999"').encode()),
        "is cut short": file("short.stl", stl[:-10]),
        "not an STL: it has 3 bytes": file("tiny.stl", b"abc"),
        "has no triangle": file("empty.obj", b"v 0 0 0\n"),
        "nan.obj: a coordinate": file("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        "not a readable .obj file": file("index.obj", b"v 0 0 0\nf 1 2 999999\n"),
        "bomb.dae:1: the DAE declares a document type": file("bomb.dae", bomb),
        "text.dae:1: this is not XML": file("text.dae", b"hello"),
        "odd.dae: the DAE has no scene": file("odd.dae", b"<COLLADA/>"),
        "one of .stl, .obj, .dae, not .ply": file("mesh.ply", b"ply"),
        "pipe, socket or device": tmp_path / "pipe.stl",
        f"the limit of a mesh is {MAX_BYTES}": tmp_path / "long.stl",
        "is a folder": tmp_path / "folder.stl",
        "No such file": tmp_path / "missing.stl",
    }
    (tmp_path / "folder.stl").mkdir()
    for told, path in cases.items():
        with pytest.raises(BadMesh) as error:
            read_mesh(path)
        assert told in str(error.value), path.name
        assert str(path) in str(error.value)


def test_a_dae_is_shown_with_the_colours_of_its_materials(tmp_path: Path) -> None:
    looks = (
        '<library_effects><effect id="e"><profile_COMMON><technique sid="c"><lambert><diffuse><color>1 0 0.5 1</color>'
        "</diffuse></lambert></technique></profile_COMMON></effect></library_effects><library_materials>"
        '<material id="m"><instance_effect url="#e"/></material></library_materials><library_geometries>'
    )
    bound = (
        '<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="s" target="#m"/>'
        "</technique_common></bind_material></instance_geometry>"
    )
    text = dae_cube().replace("<library_geometries>", looks).replace('<instance_geometry url="#g"/>', bound)
    path = tmp_path / "red.dae"
    path.write_text(text.replace('<polylist count="6">', '<polylist count="6" material="s">'))
    mesh = read_mesh(path)
    colours = read_colours(path, mesh)
    assert colours is not None
    assert colours.tolist() == [[255, 0, 127, 255]] * 12
    write_glb(tmp_path / "red.glb", mesh, colours)
    shown = trimesh.load_mesh(tmp_path / "red.glb", process=False)
    assert shown.bounds.tolist() == mesh.bounds.tolist()
    assert np.unique(shown.visual.vertex_colors, axis=0).tolist() == [[255, 0, 127, 255]]
    path.write_text(text.replace("<color>1 0 0.5 1</color>", "<color>red</color>"))
    assert read_mesh(path).bounds.tolist() == mesh.bounds.tolist(), "a broken material costs no shape"
