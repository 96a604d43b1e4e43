"""Expands xacro files with the package ``xacro``, in a child process with limits on time and memory.

A xacro is code: it evaluates expressions and reads files and the environment. Only files named by the user are
expanded, never anything received over the network.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from messages.errors import BadInput

MAX_TIME_S = 20
"""Maximum processor time of an expansion [s]; the largest published robots take 2 s."""
MAX_WAIT_S = 300.0
"""Maximum wall time [s], likewise: a busy machine may be slow, and a xacro may read a file that never ends."""
MAX_MEMORY = 2 << 30
"""Maximum address space of the child [bytes]."""

_CHILD = Path(__file__).with_name("xacro_child.py")
_ROOT = Path(__file__).resolve().parent.parent

XacroValue = str | float | int | bool
"""Value of a xacro argument."""


class BadXacro(BadInput):
    """A xacro cannot be expanded; the text says where and why."""


def expand_xacro(
    path: Path,
    args: Mapping[str, XacroValue],
    packages: Sequence[Path] = (),
    max_time: int = MAX_TIME_S,
    max_wait: float = MAX_WAIT_S,
) -> str:
    """Expand a xacro to a URDF; raises BadXacro.

    Args:
        path: The xacro.
        args: Values of its ``<xacro:arg>``.
        packages: Folders of packages for ``$(find NAME)``, in addition to those of ``models.packages``.
        max_time: Maximum processor time [s].
        max_wait: Maximum wall time [s].
    """
    request = {
        "file": os.path.abspath(path),
        "args": {name: _text(value) for name, value in args.items()},
        "packages": [str(each) for each in packages],
        "memory": MAX_MEMORY,
        "time": max_time,
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
        answer, errors = child.communicate(json.dumps(request).encode(), max_wait)
    except subprocess.TimeoutExpired:
        child.kill()
        child.communicate()
        raise BadXacro(f"{path}: the xacro was not expanded within {max_wait:g} s: what does it wait for?") from None
    if child.returncode == -signal.SIGXCPU:
        raise BadXacro(
            f"{path}: the xacro was not expanded within {max_time} s of processor time: does a macro call itself?"
        )
    try:
        found = json.loads(answer)
    except ValueError:
        last = errors.decode(errors="replace").strip().rpartition("\n")[2]
        raise BadXacro(f"{path}: the xacro could not be expanded (status {child.returncode}): {last[:300]}") from None
    if "error" in found:
        raise BadXacro(found["error"])
    return str(found["urdf"])


def _text(value: XacroValue) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
