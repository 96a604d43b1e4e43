"""Creates the folder of an imported robot: its URDF in general, for the engine and for the viewer, and its meshes."""

from __future__ import annotations

import hashlib
import html
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import msgspec

from messages.errors import BadInput
from models.engine_fit import DrivenWheels, find_suspensions, fit_urdf
from models.gazebo_tags import parse_gazebo_tags
from models.inertials import repair_inertias
from models.inferred import infer_model
from models.input_file import read_limited
from models.mesh import Mesh, read_mesh
from models.model import INFERRED_FILE
from models.packages import FileAccess, PackagePath, find_file
from models.robot_cache import robots_folder, write_folder
from models.robot_facts import RobotFacts
from models.shapes import read_shapes
from models.urdf import located, parse_urdf, parse_xml
from models.urdf_writer import EngineFiles, extents, physics_urdf, viewer_urdf

FORMAT = "17"
"""Format version; increased when the same robot would produce other files."""
MAX_MODEL_TOML = 1 << 20
"""Maximum size of a ``model.toml`` [bytes]."""
MAX_MESHES = 500
"""Maximum number of different meshes of a robot."""
MAX_ALL_TRIANGLES = 2_000_000
"""Maximum number of triangles in all meshes of a robot."""

_OPEN_NAMES = re.compile(r"\$\{(?:namespace|ns|prefix|frame_prefix|tf_prefix)\}")
"""Placeholders that launch files replace in a plain URDF, e.g. those of TurtleBot3."""


class _NamedFiles:
    """The files that a URDF refers to, each resolved and read once; ``hashes`` covers their content."""

    def __init__(self, path: Path | None, base: Path, packages: PackagePath, access: FileAccess) -> None:
        self._path, self._source, self._packages, self._access = path, path or base / "text", packages, access
        self._meshes: dict[Path, Mesh] = {}
        self.found: dict[str, Path] = {}
        """Resolved files by their names in the URDF."""
        self.hashes = hashlib.sha256()

    def read(self, uri: str) -> Mesh:
        """Read a mesh that the URDF refers to; raises BadInput."""
        file = self._find(uri)
        if file not in self._meshes:
            if not file.exists():
                raise BadInput(f"the mesh {uri} is missing: there is no {file}")
            if len(self._meshes) >= MAX_MESHES:
                raise BadInput(f"the robot has more than {MAX_MESHES} meshes")
            self._add(file, read_mesh(file))
        return self._meshes[file]

    def _find(self, uri: str) -> Path:
        if uri not in self.found:
            if self._path is None and "://" not in uri and not os.path.isabs(uri):
                raise BadInput(f"mesh {uri!r}: a URDF without a file refers to its meshes by package:// or file://")
            self.found[uri] = find_file(uri, self._source, self._packages, self._access)
        return self.found[uri]

    def _add(self, file: Path, mesh: Mesh) -> None:
        self._meshes[file] = mesh
        self.hashes.update(mesh.vertices.tobytes() + mesh.triangles.tobytes())
        total = sum(len(each.triangles) for each in self._meshes.values())
        if total > MAX_ALL_TRIANGLES:
            raise BadInput(f"all meshes of the robot have {total:,} triangles, the limit is {MAX_ALL_TRIANGLES:,}")


def make_robot(
    name: str,
    urdf: str,
    path: Path | None,
    label: str,
    config: Path | None,
    packages: PackagePath,
    access: FileAccess,
    base: Path | None = None,
    faults: list[str] | None = None,
) -> Path:
    """Read all files of a robot, and create its folder unless it exists; raises BadInput.

    Args:
        name: Display name; the URDF's if empty.
        urdf: The text.
        path: The user's file, None for a text without one.
        label: Name of the text in errors.
        config: Its ``model.toml``, if there is one.
        packages: Search path of packages.
        access: What may be read.
        base: The folder above which the packages of a text are searched for.
        faults: Collects errors of unreadable meshes, which are then left out; without a list they are raised.

    Returns:
        The folder.
    """
    notes: list[str] = []
    if _OPEN_NAMES.search(urdf):
        urdf = _OPEN_NAMES.sub("", urdf)
        notes.append("placeholders for a prefix, such as ${namespace}, are removed from its names")
    robot, description = parse_xml(urdf, label), parse_urdf(urdf, label)
    files = _NamedFiles(path, base or Path("/"), packages, access)
    with located(label):
        shapes = read_shapes(robot, files.read, faults)
        repaired = repair_inertias(description, shapes)
    name = re.sub(r"[^A-Za-z0-9_.]+", "_", name or description.name).strip("_.")[:60] or "robot"
    resolved = _with_paths(urdf, {uri: f"file://{file}" for uri, file in files.found.items()})
    toml = read_limited(config, MAX_MODEL_TOML, "a model.toml") if config is not None else b""
    files.hashes.update("\0".join((FORMAT, resolved, str(path), *(faults or ()), "")).encode() + toml)
    folder = robots_folder() / f"{name}-{files.hashes.hexdigest()[:16]}"
    if (folder / "facts.json").is_file():
        return folder

    def write(into: Path) -> None:
        contacts = {each.get("name", ""): contact for each in robot if (contact := each.find("contact")) is not None}
        shown = path.name if path is not None else label
        tags = parse_gazebo_tags(resolved, shown)
        inferred_notes: tuple[str, ...] = ()
        if config is not None:
            driven = _stated_wheels(toml)
        else:
            model, inferred_notes = infer_model(description, shapes, tags, shown)
            driven = DrivenWheels.of(model)
            (into / INFERRED_FILE).write_bytes(msgspec.json.encode(model))
        suspensions = find_suspensions(description, driven)
        published, simulated = _with_fixed_joints(resolved, suspensions), description
        fixed: list[str] = []
        if suspensions:
            simulated = parse_urdf(published)
            names = ", ".join(suspensions)
            fixed.append(f"wheel suspensions, which are fixed since springs are not simulated: {names}")
        written = EngineFiles(into, folder)
        physics, assumed = physics_urdf(simulated, shapes, repaired.inertias, contacts, written)
        fit = fit_urdf(physics, simulated, shapes, tags.friction, driven)
        viewer = viewer_urdf(simulated, shapes, files.found, written)
        viewer = _with_paths(viewer, {uri: str(file) for uri, file in files.found.items()})
        for file, text in (("robot.urdf", published), ("physics.urdf", fit.text), ("viewer.urdf", viewer)):
            (into / file).write_text(text, encoding="utf-8")
        if config is not None:
            (into / "model.toml").write_bytes(toml)
        reach, lowest, highest = extents(simulated, shapes)
        left_out = [f"{label}: {each}" for shape in shapes.values() for each in shape.remarks]
        facts = RobotFacts(
            name=name,
            title=description.name,
            origin=str(path or ""),
            reach=reach,
            lowest=lowest,
            highest=highest,
            notes=(*notes, *left_out, *description.warnings, *repaired.notes, *assumed, *inferred_notes, *fixed),
            height=fit.height,
            starts=fit.starts,
            skid=fit.skid,
            wheels=fit.wheels,
            ignored=tags.ignored,
        )
        (into / "facts.json").write_bytes(msgspec.json.encode(facts))

    write_folder(folder, write)
    return folder


def _stated_wheels(toml: bytes) -> DrivenWheels:
    """Return the driven wheels of a ``model.toml``; none if it is invalid, which ``read_model`` reports."""
    try:
        config = msgspec.toml.decode(toml, type=_BaseTables)
    except msgspec.MsgspecError:
        return DrivenWheels()
    wheels = config.wheels
    if wheels is None:
        return DrivenWheels(holonomic=config.planar is not None)
    left, right = (wheels.left_joint, *wheels.other_left), (wheels.right_joint, *wheels.other_right)
    return DrivenWheels(left, right, wheels.radius)


class _StatedWheels(msgspec.Struct):
    left_joint: str
    right_joint: str
    other_left: tuple[str, ...] = ()
    other_right: tuple[str, ...] = ()
    radius: float = 0.0


class _BaseTables(msgspec.Struct):
    wheels: _StatedWheels | None = None
    planar: dict[str, float] | None = None


def _with_fixed_joints(urdf: str, joints: Sequence[str]) -> str:
    """Return the text with these joints fixed, keeping its lines."""

    def fixed(found: re.Match[str]) -> str:
        name = re.search(r"\bname\s*=\s*[\"']([^\"']*)", found[0])
        if name is None or name[1] not in joints:
            return found[0]
        return re.sub(r"(\btype\s*=\s*[\"'])prismatic", r"\1fixed", found[0])

    return re.sub(r"<joint\b[^<>]*>", fixed, urdf) if joints else urdf


def _with_paths(urdf: str, paths: Mapping[str, str]) -> str:
    """Return the text with renamed files and its encoding declared as UTF-8, keeping its lines."""

    def renamed(found: re.Match[str]) -> str:
        uri = html.unescape(found[3] if found[3] is not None else found[4])
        return f"{found[1]}{quoteattr(paths[uri])}" if uri in paths else found[0]

    declared = re.sub(r"(<\?xml[^>]*\bencoding\s*=\s*[\"'])[\w.-]+", r"\1utf-8", urdf, count=1)
    return re.sub(r"(<mesh\b[^<>]*?\bfilename\s*=\s*)(\"([^\"]*)\"|'([^']*)')", renamed, declared)
