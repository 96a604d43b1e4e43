"""The one tree of errors.

EleaError
├── BadInput (ValueError)        a file, flag, name or value from outside is wrong       -> exit status 2
├── CallFailed (RuntimeError)    a request was refused, or nobody answered in time
└── Stopped                      the process was asked to end; unwinds the loop          -> exit status 0
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class EleaError(Exception):
    """Anything that this project raises on purpose."""


class BadInput(EleaError, ValueError):
    """Something from outside is wrong: the text says what, where, the limit and the likely cause."""


class CallFailed(EleaError, RuntimeError):
    """A request got an error reply, or none within its deadline."""


class Stopped(EleaError):
    """The process was asked to end."""


def unknown(kind: str, name: str, known: Iterable[str], where: str = "") -> BadInput:
    """The error for a name that does not exist, with the nearest right one and the alternatives."""
    names = sorted(known)
    near = difflib.get_close_matches(name, names, 1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    prefix = f"{where}: " if where else ""
    return BadInput(f"{prefix}unknown {kind} {name!r}{hint} (known: {', '.join(names) or 'none'})")
