"""Expands xacro files by the package ``xacro``, in a child process with bounds on time and memory.

A xacro is code: it evaluates expressions, reads files and the environment. Only what the user himself names is
expanded, nothing that comes over the network.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from messages.errors import BadInput

DEADLINE_S = 20.0
"""Wall time after which an expansion is ended; the largest published robots take 2 s."""
MAX_MEMORY = 2 << 30
"""Bytes of address space of the child."""

_CHILD = Path(__file__).with_name("xacro_child.py")
_ROOT = Path(__file__).resolve().parent.parent

XacroValue = str | float | int | bool
"""A value of an argument."""


class BadXacro(BadInput):
    """A xacro cannot be expanded; the text says where and why."""


def expand_xacro(
    path: Path, args: Mapping[str, XacroValue], packages: Sequence[Path] = (), deadline: float = DEADLINE_S
) -> str:
    """The URDF that a xacro makes; raises BadXacro.

    Args:
        path: The xacro.
        args: Values of its ``<xacro:arg>``.
        packages: Folders of packages for ``$(find NAME)``, beside those of ``models.packages``.
        deadline: Wall time, s.
    """
    request = {
        "file": os.path.abspath(path),
        "args": {name: _text(value) for name, value in args.items()},
        "packages": [str(each) for each in packages],
        "memory": MAX_MEMORY,
    }
    search = os.pathsep.join(dict.fromkeys([str(_ROOT), *(each for each in sys.path if each)]))
    child = subprocess.Popen(
        [sys.executable, "-P", str(_CHILD)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": search},
        start_new_session=True,
    )
    try:
        answer, said = child.communicate(json.dumps(request).encode(), deadline)
    except subprocess.TimeoutExpired:
        child.kill()
        child.communicate()
        raise BadXacro(f"{path}: the xacro was not expanded within {deadline:g} s: does a macro call itself?") from None
    try:
        found = json.loads(answer)
    except ValueError:
        last = said.decode(errors="replace").strip().rpartition("\n")[2]
        raise BadXacro(f"{path}: the xacro could not be expanded (status {child.returncode}): {last[:300]}") from None
    if "error" in found:
        raise BadXacro(found["error"])
    return str(found["urdf"])


def _text(value: XacroValue) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
