"""Finds what SDF files refer to: models by ``model://`` or a path, and the files in them.

A model is searched for as in ``models.packages``, and also, as Gazebo packages are laid out, in the folder ``models``
of every folder above the file, and in GAZEBO_RESOURCE_PATH, IGN_GAZEBO_RESOURCE_PATH and SDF_PATH.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

from messages.errors import BadInput, did_you_mean
from models.packages import OWNER, FileAccess, FileMissing, PackagePath, find_file
from models.sdf_xml import read_sdf

FURTHER_VARIABLES = ("GAZEBO_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "SDF_PATH")
_MOST_LISTED = 500


def find_resource(uri: str, source: Path, packages: PackagePath, access: FileAccess = OWNER) -> Path:
    """Find the file or folder that a URI in ``source`` refers to; raises BadInput, FileMissing if it does not exist."""
    # Gazebo ignores further slashes before the name of a model.
    uri = re.sub(r"^(model|package):/{3,}", r"\1://", unquote(uri.strip()))
    scheme, _, rest = uri.partition("://")
    missing = None
    if scheme == "file" and not rest.startswith("/"):
        # Gazebo searches for file://models/NAME/... in its resource paths, which include the package.
        for above in Path(os.path.abspath(source)).parents:
            if (above / rest).is_file():
                return find_file(str(above / rest), source, packages, access)
    if scheme in ("model", "package"):
        name = rest.partition("/")[0]
        for folder in _model_folders(source, packages):
            if name == rest and scheme == "model" and (folder / name).is_file():
                # A mesh directly in a folder of models.
                return find_file(str((folder / name).absolute()), source, packages, access)
            if name and (folder / name).is_dir():
                # Resolving it from inside the model finds it there and ensures that it does not lead outside.
                found = find_file(uri, folder / name / "model.sdf", packages, access)
                if found.exists():
                    return found
                missing = missing or found
    try:
        found = find_file(uri, source, packages, access)
    except BadInput as error:
        if missing is not None:
            raise FileMissing(f"{uri}: there is no {missing}") from None
        near = did_you_mean(rest.partition("/")[0], _models(source, packages)) if scheme == "model" else ""
        text = str(error)
        kind = FileMissing if isinstance(error, FileMissing) else BadInput
        raise kind(text if not near else re.sub(r"; did you mean [^;]*?\?(?=:)", "", text) + near) from None
    if not found.exists():
        raise FileMissing(f"{uri}: there is no {missing or found}")
    return found


def find_model_file(uri: str, source: Path, packages: PackagePath, access: FileAccess = OWNER) -> Path | None:
    """Find the SDF file of an ``<include>`` in ``source``; None for one on the Internet. Raises BadInput."""
    uri = uri.strip()
    if re.match(r"https?://", uri):
        # Fuel URLs end with the model's name; a local model of that name is used.
        name = re.sub(r"/\d+$", "", uri.rstrip("/")).rpartition("/")[2]
        try:
            return find_model_file(f"model://{name}", source, packages, access)
        except BadInput:
            return None
    try:
        found = find_resource(uri, source, packages, access)
    except BadInput:
        if "/" in uri:
            raise
        found = find_resource(f"model://{uri}", source, packages, access)
    if found.is_dir():
        found = _sdf_of(found, uri)
    access.check(found, uri)
    return found.resolve()


def _sdf_of(folder: Path, uri: str) -> Path:
    """Return the SDF file of the newest version in a model's ``model.config``."""
    config = folder / "model.config"
    if config.is_file():
        sheets = [each for each in read_sdf(config, ("model",)).children if each.tag == "sdf" and each.text]
        for each in sorted(sheets, key=lambda each: _version(each.attributes.get("version", "0")), reverse=True):
            file = (folder / each.text).resolve()
            if not file.is_relative_to(folder.resolve()):
                raise BadInput(f"{uri}: {config}:{each.line}: {each.text} leads out of the model")
            if file.is_file():
                return file
    if (folder / "model.sdf").is_file():
        return folder / "model.sdf"
    raise BadInput(f"{uri}: {folder} has neither a model.config that names an SDF nor a model.sdf")


def _model_folders(source: Path, packages: PackagePath) -> Iterator[Path]:
    """Yield folders of models in addition to those of ``models.packages``."""
    for each in packages.folders:
        yield from (each, each / "models")
    for above in list(Path(os.path.abspath(source)).parents)[:-1]:
        yield above / "models"
    for variable in FURTHER_VARIABLES:
        yield from (Path(each) for each in packages.environment.get(variable, "").split(os.pathsep) if each)


def _models(source: Path, packages: PackagePath) -> list[str]:
    """Return the names of models found in these folders."""
    found: list[str] = []
    for folder in _model_folders(source, packages):
        try:
            found += [each.name for each in sorted(folder.iterdir())[:_MOST_LISTED] if each.is_dir()]
        except OSError:
            continue
    return found[:_MOST_LISTED]


def _version(text: str) -> tuple[int, ...]:
    return tuple(int(each) for each in re.findall(r"\d{1,9}", text)) or (0,)
