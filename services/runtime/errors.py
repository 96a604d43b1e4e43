"""The one tree of errors.

EleaError
├── BadInput (ValueError)        a file, flag, name or value from outside is wrong       -> exit status 2
│   └── TryAgain                 it is wrong for now: a name taken, a network out of reach -> exit status 75
├── CallFailed (RuntimeError)    a request was refused, or nobody answered in time
│   ├── NoAnswer                 nobody serves it, or nobody answered in time
│   └── SeveralServers           more than one process answered it
├── NoTransform (LookupError)    where one frame lies in another cannot be told
│   ├── UnknownFrame             nobody has told of a frame of this name
│   ├── NotConnected             the two frames lie in different trees
│   ├── Extrapolation            the time lies outside what is known
│   └── FrameLoop                a frame lies above itself
└── Stopped                      the process was asked to end; unwinds the loop          -> exit status 0
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

TRY_AGAIN = 75
"""Exit status after TryAgain: EX_TEMPFAIL of sysexits(3)."""


_MOST_LISTED = 100
"""Alternatives that an error lists."""
_LONG = 100
_WORK = 500_000
"""Pairs of characters: 1,200 names of 20, within 4 ms; of the worst kind, 35 ms."""


class EleaError(Exception):
    """Anything that this project raises on purpose."""


class BadInput(EleaError, ValueError):
    """Something from outside is wrong: the text says what, where, the limit and the likely cause."""


class TryAgain(BadInput):
    """What was asked for cannot be had for now, through no fault of its own: the same may work a moment later."""


class CallFailed(EleaError, RuntimeError):
    """A request got an error reply, or none within its deadline."""


class NoAnswer(CallFailed):
    """Nobody serves a request, or nobody answered it in time."""


class SeveralServers(CallFailed):
    """More than one process answered a request: whose answer holds cannot be told, and all may have carried it out."""


class NoTransform(EleaError, LookupError):
    """Where one frame lies in another cannot be told; the text says why, and what there is instead."""


class UnknownFrame(NoTransform):
    """Nobody has told of a frame of this name."""


class NotConnected(NoTransform):
    """No chain of transforms leads from one frame to the other."""


class Extrapolation(NoTransform):
    """The time lies before or after what is known of a frame."""


class FrameLoop(NoTransform):
    """A frame lies above itself, so nobody can say where it is."""


class Stopped(EleaError):
    """The process was asked to end."""


def unknown_name(kind: str, name: str, known: Iterable[str], where: str = "") -> BadInput:
    """The error for a name that does not exist, with the nearest right one and the alternatives."""
    names = sorted(known)
    near = nearest(name, names)
    hint = f"; did you mean {near!r}?" if near else ""
    prefix = f"{where}: " if where else ""
    listed = ", ".join(names[:_MOST_LISTED]) or "none"
    more = f" and {len(names) - _MOST_LISTED} more" if len(names) > _MOST_LISTED else ""
    return BadInput(f"{prefix}unknown {kind} {name[:255]!r}{hint} (known: {listed}{more})")


def nearest(name: str, known: Iterable[str]) -> str:
    """The name of ``known`` that ``name`` may have been meant for, or nothing.

    Names come from outside and are as long and as many as somebody likes, and comparing two takes the product of their
    lengths: a name of 100 characters or more is compared with none, others with those nearest to its length for as
    long as _WORK lasts.
    """
    if len(name) >= _LONG:
        return ""
    work, candidates = 0, []
    for each in sorted(known, key=lambda each: abs(len(each) - len(name))):
        work += len(name) * len(each)
        if work > _WORK or len(each) >= _LONG:
            break
        candidates.append(each)
    near = difflib.get_close_matches(name, candidates, 1)
    return near[0] if near else ""
