"""Expands one xacro in a separate process: reads a JSON request from stdin, writes the URDF or the error as JSON to
stdout.

Not imported: ``models.xacro_file`` runs it, with limits on memory and time.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import traceback
import xml.dom.minidom as minidom
from pathlib import Path
from typing import Any
from xml.dom import expatbuilder
from xml.parsers import expat

import xacro
from xacro import substitution_args

from messages.errors import BadInput
from models.packages import PackagePath

_OLD_TAGS = {
    "property": ("name",),
    "macro": ("name",),
    "include": ("filename",),
    "insert_block": ("name",),
    "if": ("value",),
    "unless": ("value",),
}
"""Tags that xacro once accepted without its prefix, with the attributes that distinguish them from others."""
_URDF_TAGS = (
    "robot link joint visual collision inertial geometry box cylinder sphere capsule mesh origin material color "
    "texture inertia mass parent child axis limit dynamics mimic safety_controller calibration transmission actuator "
    "gazebo sensor plugin camera ray"
)
"""Tags that are not macro calls, even if a macro has the name."""


def main() -> None:
    """Read the request and write the answer."""
    request = json.load(sys.stdin)
    resource.setrlimit(resource.RLIMIT_AS, (request["memory"], request["memory"]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # At the limit, SIGXCPU is sent; a process that survives it is killed a second later.
    resource.setrlimit(resource.RLIMIT_CPU, (request["time"], request["time"] + 1))
    answers, sys.stdout = sys.stdout, sys.stderr
    _find_packages(request)
    _track_lines()
    _accept_old_names()
    try:
        document = xacro.process_file(request["file"], mappings=dict(request["args"]), verbosity=0)
        answer = {"urdf": document.toprettyxml(indent="  ")}
    except RecursionError as error:
        answer = {"error": f"{_place(error, request['file'])}: {_circle()}"}
    except expat.ExpatError as error:
        answer = {"error": f"{_current_file(request['file'])}:{error.lineno}: this is not XML: {error}"}
    except Exception as error:  # noqa: BLE001  (the code of a foreign file: it may raise anything)
        answer = {"error": f"{_place(error, request['file'])}: {_message(error)}"}
    json.dump(answer, answers)


def _find_packages(request: dict[str, Any]) -> None:
    """Make ``$(find NAME)`` and ``$(find-pkg-share NAME)`` search where meshes are searched for, without ROS."""
    packages = PackagePath(tuple(map(Path, request["packages"])))

    def find(name: str) -> str:
        try:
            return str(packages.find(name, Path(_current_file(request["file"]))))
        except BadInput as error:
            raise substitution_args.SubstitutionException(str(error)) from None

    substitution_args._eval_find = find
    substitution_args._eval_dict["find"] = find


def _track_lines() -> None:
    """Attach file and line to each element and its copies."""
    builder: Any = expatbuilder.Namespaces
    dom: Any = minidom
    start, clone = builder.start_element_handler, dom._clone_node

    def start_element(self: Any, name: str, attributes: Any) -> None:
        start(self, name, attributes)
        self.curNode.place = f"{_current_file('')}:{self.getParser().CurrentLineNumber}"

    def clone_node(node: Any, deep: bool, owner: Any) -> Any:
        copy = clone(node, deep, owner)
        if copy is not None and hasattr(node, "place"):
            copy.place = node.place
        return copy

    builder.start_element_handler = start_element
    dom._clone_node = clone_node


def _accept_old_names() -> None:
    """Accept xacro's tags and macro calls without the prefix ``xacro:``, as xacro did up to ROS Melodic."""
    foreign: Any = xacro
    parse, call = foreign.parse, foreign.handle_macro_call

    def parse_both(*args: Any, **options: Any) -> Any:
        document = parse(*args, **options)
        for each in document.getElementsByTagName("*"):
            if (needed := _OLD_TAGS.get(each.tagName)) is not None and all(map(each.hasAttribute, needed)):
                each.tagName = each.nodeName = f"xacro:{each.tagName}"
        return document

    def call_both(node: Any, macros: Any, symbols: Any) -> Any:
        name = node.tagName
        if ":" not in name and name not in _URDF_TAGS.split() and name in macros:
            node.tagName = node.nodeName = f"xacro:{name}"
        return call(node, macros, symbols)

    foreign.parse, foreign.handle_macro_call = parse_both, call_both


def _place(error: BaseException, file: str) -> str:
    """Return file and line of the element that was being expanded."""
    found = file
    for frame, _ in traceback.walk_tb(error.__traceback__):
        for name in ("node", "elt", "tag"):
            node = frame.f_locals.get(name)
            for each in (node, getattr(node, "parentNode", None)):
                if (place := getattr(each, "place", None)) is not None:
                    found = place
                    break
    return found


def _current_file(default: str) -> str:
    return os.path.abspath(xacro.filestack[-1]) if xacro.filestack and xacro.filestack[-1] else default


def _circle() -> str:
    files = [os.path.abspath(each) for each in xacro.filestack or [] if each]
    for each in files:
        if files.count(each) > 2:
            return f"{each} includes itself"
    return "its macros or properties refer to each other in a circle"


def _message(error: Exception) -> str:
    inner: object = error
    while isinstance(getattr(inner, "exc", None), BaseException):
        inner = inner.exc  # type: ignore[attr-defined]
    if isinstance(inner, substitution_args.ArgException):
        return f"the argument {inner} is not set: set it with xacro_args, or --arg on the command line"
    if isinstance(inner, MemoryError):
        return "it needs more memory than the limit"
    if isinstance(inner, (substitution_args.SubstitutionException, OSError)):
        return " ".join(str(inner).split())
    return " ".join(str(error).split()) or type(inner).__name__


if __name__ == "__main__":
    main()
