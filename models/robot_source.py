"""Robots from outside: a path to a URDF, a xacro or a folder becomes a folder of files that every process reads.

What is made of a robot lies in ``robots_folder()``, in a folder named after the robot and the hash of all that it is
made of: a robot whose file has changed is another one, and what runs keeps its own. ``RobotSource.model`` names it
wherever a model is named: in a fleet, in a request to spawn, in a service's parameters.
"""

from __future__ import annotations

import hashlib
import html
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

import msgspec

from messages.errors import BadInput, unknown_name
from models import MODELS, UnknownModel, model_config_path, urdf_path
from models.engine_fit import DrivenWheels, fit_urdf
from models.gazebo_tags import parse_gazebo_tags
from models.inertials import mend_inertias
from models.inferred import infer_model
from models.input_file import read_limited
from models.mesh import Mesh, read_mesh
from models.model import INFERRED_FILE, read_model
from models.packages import OWNER, FileAccess, PackagePath, find_file
from models.robot_cache import MADE, robots_folder, write_folder
from models.robot_facts import RobotFacts, read_facts
from models.shapes import read_shapes
from models.urdf import located, parse_urdf, parse_xml, read_urdf
from models.urdf_writer import EngineFiles, extents, physics_urdf, viewer_urdf
from models.xacro_file import XacroValue, expand_xacro

FORMAT = "5"
"""Changes when other files are made of the same robot."""
MAX_MODEL_TOML = 1 << 20
"""Bytes of a ``model.toml``."""
MAX_MESHES = 500
"""Different meshes of a robot."""
MAX_ALL_TRIANGLES = 2_000_000
"""Triangles of all meshes of a robot together."""

_FILES = ("robot.urdf", "robot.urdf.xacro", "robot.xacro")
_OPEN_NAMES = re.compile(r"\$\{(?:namespace|ns|prefix|frame_prefix|tf_prefix)\}")
"""Placeholders that launch files replace in a plain URDF, as those of TurtleBot3 do."""


@dataclass(frozen=True)
class RobotSource:
    """A robot's files: its ``urdf`` with all meshes as absolute paths, and a ``model_toml`` if there is one.

    ``model`` names the robot in fleets, requests and parameters, ``name`` is for people. ``notes`` say what was
    assumed.
    """

    model: str
    name: str
    urdf: Path
    model_toml: Path | None
    notes: tuple[str, ...] = ()


def names_file(model: str) -> bool:
    """Whether a model is named by a path, not by the name of one of this folder."""
    return "/" in model or model.endswith((".urdf", ".xacro")) or model in (".", "..", "~")


def resolve_robot(
    model: str,
    base: Path,
    packages: Sequence[Path] = (),
    xacro_args: Mapping[str, XacroValue] | None = None,
    access: FileAccess = OWNER,
    faults: list[str] | None = None,
) -> RobotSource:
    """The files of a robot; raises BadInput, with file and line.

    Args:
        model: A name of ``models/``; the name that ``RobotSource.model`` had; or a path to a URDF, a xacro, or a folder
            with one of them and perhaps a ``model.toml``.
        base: The folder that a relative path counts from.
        packages: Folders in which ``package://`` is looked for beside those of ROS; each is a package or holds some.
        xacro_args: Values of a xacro's arguments.
        access: What may be read.
        faults: Gets why meshes cannot be read, and these are left out; without a list they are errors.
    """
    if model in MODELS:
        return RobotSource(model, model, urdf_path(model), model_config_path(model))
    if (made := find_made(model)) is not None:
        return made
    if not names_file(model):
        error = unknown_name("model", model, MODELS)
        own = model if (base / model).is_dir() else f"{model[:80]}.urdf"
        raise UnknownModel(f"{error}; a robot of your own is named by its path, as ./{own}")
    path = _robot_file(base / os.path.expanduser(model) if access.folders is None else base / model, access)
    if path.suffix.lower() == ".xacro":
        if not access.run_xacro:
            raise BadInput(
                f"{path}: a xacro is code, and none that a request names is run: spawn it with ./elea sim spawn, "
                "which expands it at your side, or send the URDF"
            )
        urdf, told = expand_xacro(path, xacro_args or {}, packages), f"{path} (expanded)"
    else:
        urdf, told = read_urdf(path), str(path)
        if "<xacro:" in urdf and access.run_xacro:
            urdf, told = expand_xacro(path, xacro_args or {}, packages), f"{path} (expanded)"
        elif xacro_args:
            raise BadInput(f"{path}: xacro_args are for a xacro, and this is a plain URDF")
    toml = path.with_name("model.toml")
    config = toml if path.name in _FILES and toml.exists() else None
    found = _make(_name_of(path), urdf, path, told, config, PackagePath(tuple(packages)), access, faults)
    read_model(found.model)
    return found


def resolve_urdf_text(
    urdf: str, packages: Sequence[Path] = (), access: FileAccess = OWNER, name: str = ""
) -> RobotSource:
    """The files of a robot whose URDF is given as text; raises BadInput, with the line."""
    if "<xacro:" in urdf:
        raise BadInput("this text is a xacro: it is code, and is not run; send the URDF that the command xacro makes")
    return _make(name, urdf, None, name or "the URDF", None, PackagePath(tuple(packages)), access)


def find_made(model: str) -> RobotSource | None:
    """The robot that ``RobotSource.model`` names, None if there is none: it was never made, or is unused for long."""
    folder = Path(model) if "/" in model else robots_folder() / model
    if not MADE.fullmatch(folder.name) or folder.parent != robots_folder() or not (folder / "facts.json").is_file():
        return None
    os.utime(folder)
    return _source(folder)


def _source(folder: Path) -> RobotSource:
    facts, toml = read_facts(str(folder)), folder / "model.toml"
    return RobotSource(str(folder), facts.name, folder / "robot.urdf", toml if toml.is_file() else None, facts.notes)


def _robot_file(path: Path, access: FileAccess) -> Path:
    """The URDF or xacro that a path means."""
    path = Path(os.path.abspath(path))
    access.check(path, str(path))
    if not path.is_dir():
        if not path.exists():
            near = _siblings(path)
            raise BadInput(f"there is no file {path}{near}")
        return path
    for name in _FILES:
        if (path / name).is_file():
            return path / name
    found = [each for folder in (path, path / "urdf") for each in sorted(folder.glob("*")) if _is_robot_file(each)]
    if len(found) == 1:
        access.check(found[0], str(found[0]))
        return found[0]
    if not found:
        raise BadInput(f"{path} holds no robot: a folder of a robot has robot.urdf, or one URDF or xacro")
    names = ", ".join(str(each.relative_to(path)) for each in found[:20])
    raise BadInput(f"{path} holds {len(found)} robots, name one of them: {names}")


def _is_robot_file(path: Path) -> bool:
    return path.suffix.lower() in (".urdf", ".xacro")


def _siblings(path: Path) -> str:
    try:
        names = [each.name for each in path.parent.iterdir() if _is_robot_file(each) or each.is_dir()]
    except OSError:
        return ""
    return f" (in its folder: {', '.join(sorted(names)[:20])})" if names else ""


def _name_of(path: Path) -> str:
    """``my_robot`` of ``my_robot.urdf.xacro``; of ``robot.urdf`` it is the folder's."""
    stem = path.name.split(".")[0]
    return path.parent.name if path.name in _FILES else stem


class _NamedFiles:
    """The files that a URDF names, each found and read once; ``hashes`` grows with what they hold."""

    def __init__(self, path: Path | None, packages: PackagePath, access: FileAccess) -> None:
        self._path, self._packages, self._access = path, packages, access
        self._meshes: dict[Path, Mesh] = {}
        self.found: dict[str, Path] = {}
        """By what the URDF calls them."""
        self.hashes = hashlib.sha256()

    def read(self, said: str) -> Mesh:
        """The mesh that the URDF names; raises BadInput."""
        file = self._find(said)
        if file not in self._meshes:
            if not file.exists():
                raise BadInput(f"the mesh {said} is missing: there is no {file}")
            if len(self._meshes) >= MAX_MESHES:
                raise BadInput(f"the robot has more than {MAX_MESHES} meshes")
            self._add(file, read_mesh(file))
        return self._meshes[file]

    def _find(self, said: str) -> Path:
        if said not in self.found:
            if self._path is None and "://" not in said and not os.path.isabs(said):
                raise BadInput(f"mesh {said!r}: a URDF without a file names its meshes by package:// or file://")
            self.found[said] = find_file(said, self._path or Path("/robot.urdf"), self._packages, self._access)
        return self.found[said]

    def _add(self, file: Path, mesh: Mesh) -> None:
        self._meshes[file] = mesh
        self.hashes.update(mesh.vertices.tobytes() + mesh.triangles.tobytes())
        total = sum(len(each.triangles) for each in self._meshes.values())
        if total > MAX_ALL_TRIANGLES:
            raise BadInput(f"all meshes of the robot have {total:,} triangles, the limit is {MAX_ALL_TRIANGLES:,}")


def _make(
    name: str,
    urdf: str,
    path: Path | None,
    told: str,
    config: Path | None,
    packages: PackagePath,
    access: FileAccess,
    faults: list[str] | None = None,
) -> RobotSource:
    """Read all that belongs to a robot, and write its folder unless it is there already."""
    notes: list[str] = []
    if _OPEN_NAMES.search(urdf):
        urdf = _OPEN_NAMES.sub("", urdf)
        notes.append("placeholders for a prefix, as ${namespace}, are left out of its names")
    robot, description = parse_xml(urdf, told), parse_urdf(urdf, told)
    files = _NamedFiles(path, packages, access)
    with located(told):
        shapes = read_shapes(robot, files.read, faults)
        mended = mend_inertias(description, shapes)
    name = re.sub(r"[^A-Za-z0-9_.]+", "_", name or description.name).strip("_.")[:60] or "robot"
    resolved = _with_paths(urdf, {said: f"file://{file}" for said, file in files.found.items()})
    toml = read_limited(config, MAX_MODEL_TOML, "a model.toml") if config is not None else b""
    files.hashes.update("\0".join((FORMAT, resolved, str(path), *(faults or ()), "")).encode() + toml)
    folder = robots_folder() / f"{name}-{files.hashes.hexdigest()[:16]}"
    if (found := find_made(str(folder))) is not None:
        return found

    def write(into: Path) -> None:
        contacts = {each.get("name", ""): contact for each in robot if (contact := each.find("contact")) is not None}
        physics, assumed = physics_urdf(description, shapes, mended.inertias, contacts, EngineFiles(into, folder))
        tags = parse_gazebo_tags(resolved, path.name if path is not None else told)
        chosen: tuple[str, ...] = ()
        if config is not None:
            driven = _stated_wheels(toml)
        else:
            model, chosen = infer_model(description, shapes, tags, path.name if path is not None else told)
            driven = DrivenWheels.of(model)
            (into / INFERRED_FILE).write_bytes(msgspec.json.encode(model))
        fit = fit_urdf(physics, description, shapes, tags.friction, driven)
        viewer = _with_paths(viewer_urdf(description, shapes), {said: str(file) for said, file in files.found.items()})
        for file, text in (("robot.urdf", resolved), ("physics.urdf", fit.text), ("viewer.urdf", viewer)):
            (into / file).write_text(text, encoding="utf-8")
        if config is not None:
            (into / "model.toml").write_bytes(toml)
        reach, lowest, highest = extents(description, shapes)
        left_out = [f"{told}: {each}" for shape in shapes.values() for each in shape.remarks]
        facts = RobotFacts(
            name=name,
            title=description.name,
            origin=str(path or ""),
            reach=reach,
            lowest=lowest,
            highest=highest,
            notes=(*notes, *left_out, *description.warnings, *mended.notes, *assumed, *chosen),
            height=fit.height,
            starts=fit.starts,
            skid=fit.skid,
            wheels=fit.wheels,
            ignored=tags.ignored,
        )
        (into / "facts.json").write_bytes(msgspec.json.encode(facts))

    write_folder(folder, write)
    return _source(folder)


def _stated_wheels(toml: bytes) -> DrivenWheels:
    """The driven wheels that a ``model.toml`` names; none where it cannot be read, which ``read_model`` says."""
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


def _with_paths(urdf: str, paths: Mapping[str, str]) -> str:
    """The text with other names of files, line by line as it was, and declared as what it is written in."""

    def renamed(found: re.Match[str]) -> str:
        said = html.unescape(found[3] if found[3] is not None else found[4])
        return f"{found[1]}{quoteattr(paths[said])}" if said in paths else found[0]

    declared = re.sub(r"(<\?xml[^>]*\bencoding\s*=\s*[\"'])[\w.-]+", r"\1utf-8", urdf, count=1)
    return re.sub(r"(<mesh\b[^<>]*?\bfilename\s*=\s*)(\"([^\"]*)\"|'([^']*)')", renamed, declared)
