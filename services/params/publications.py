"""What the parameter service publishes of each set: its schema and its values, for as long as there is such a set."""

from __future__ import annotations

from messages.parameters import ParameterSchema, ParameterValues
from messages.topics import DESCRIPTIONS, UPDATES
from services.runtime.node import Node
from services.runtime.outputs import Output

MOST_ENDING = 100
"""Sets whose publications wait for their end; beyond, the first of them end at once."""
_TICKS = 2


class Publications:
    """Two latched topics for each set.

    In lockstep, the numbers of the last messages are told at the end of the tick in which they were sent, and count
    from the next one on: a publication that ended before would never be heard to its end. Without lockstep it ends
    ``at_once``.
    """

    def __init__(self, node: Node, at_once: bool) -> None:
        self._node, self._at_once = node, at_once
        self._outputs: dict[str, tuple[Output[ParameterSchema], Output[ParameterValues]]] = {}
        self._ending: dict[str, int] = {}

    def tell(self, news: ParameterSchema | ParameterValues) -> None:
        """Publish what has changed of a set."""
        self._ending.pop(news.set, None)
        if news.set not in self._outputs:
            self._outputs[news.set] = (
                self._node.write(DESCRIPTIONS, f"{news.set}/{DESCRIPTIONS.name.removeprefix('~')}"),
                self._node.write(UPDATES, f"{news.set}/{UPDATES.name.removeprefix('~')}"),
            )
        descriptions, updates = self._outputs[news.set]
        if isinstance(news, ParameterSchema):
            descriptions.publish(news)
        else:
            updates.publish(news)

    def end(self, name: str) -> None:
        """Publish nothing of a set any more."""
        if name not in self._outputs:
            return
        self._ending[name] = _TICKS
        if self._at_once:
            self._close(name)
        elif len(self._ending) > MOST_ENDING:
            self._close(next(iter(self._ending)))

    def tick(self) -> None:
        """A tick has begun: what was sent before the last one has been heard."""
        for name, left in list(self._ending.items()):
            self._ending[name] = left - 1
            if left == 0:
                self._close(name)

    def _close(self, name: str) -> None:
        del self._ending[name]
        self._node.forget(*self._outputs.pop(name))
