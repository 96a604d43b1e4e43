"""Message templates that are filled in groups: a message of many robots takes a fifth of the time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from messages.template import Template

MAX_GROUPS = 16
"""Maximum groups of an encoder that are kept: building one takes several times as long as filling it."""


class TemplateGroup:
    """Templates with the same count of numbers, filled together."""

    def __init__(self, templates: Sequence[Template[Any]]) -> None:
        self._heads = [each.head for each in templates]
        ends = list(accumulate((len(each.rest) for each in templates), initial=0))
        self._parts = list(map(slice, ends[:-1], ends[1:]))
        self._bytes = np.frombuffer(b"".join(each.rest for each in templates), np.uint8).copy()
        places = [[start + place for place in each.places] for start, each in zip(ends, templates, strict=False)]
        self._places = (np.array(places, np.intp)[..., None] + np.arange(8)).ravel()

    def encode(self, stamp: bytes, numbers: NDArray[np.float64]) -> list[bytes]:
        """Return the message of each template, filled with its row of ``numbers``, shape (templates, count)."""
        self._bytes[self._places] = np.ascontiguousarray(numbers, ">f8").view(np.uint8).ravel()
        rests = self._bytes.tobytes()
        return [head + stamp + rests[part] for head, part in zip(self._heads, self._parts, strict=True)]


class GroupEncoder:
    """Fills groups of templates; which ones are due changes from one call to the next, but recurs."""

    def __init__(self) -> None:
        self._group = lru_cache(MAX_GROUPS)(TemplateGroup)

    def encode(self, templates: Iterable[Template[Any]], stamp: bytes, numbers: NDArray[np.float64]) -> list[bytes]:
        """Return the message of each template, see ``TemplateGroup.encode``."""
        return self._group(tuple(templates)).encode(stamp, numbers)
