"""Which topics are recorded."""

from __future__ import annotations

import re
from collections.abc import Callable

from messages.names import BadName
from services.recorder import RecorderParameters
from services.runtime.errors import BadInput


class Selection:
    """The topics that parameters choose; ``resolve`` makes a name absolute. Raises BadInput for what is no name."""

    def __init__(self, params: RecorderParameters, resolve: Callable[[str], str]) -> None:
        try:
            self.named = frozenset(resolve(name) for name in params.topics)
        except BadName as error:
            raise BadInput(f"recorder, topics: {error}") from None
        self._regex, self._exclude = _pattern("regex", params.regex), _pattern("exclude", params.exclude)
        self._all = not params.topics and self._regex is None

    def __contains__(self, topic: str) -> bool:
        if self._exclude is not None and self._exclude.search(topic):
            return False
        return self._all or topic in self.named or bool(self._regex is not None and self._regex.search(topic))


def _pattern(name: str, text: str) -> re.Pattern[str] | None:
    try:
        return re.compile(text) if text else None
    except re.error as error:
        raise BadInput(f"recorder, {name}: {text!r} is not a regular expression: {error}") from None
