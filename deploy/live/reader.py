"""Samples as plain values: by their record where this project has it, by what MessagePack tells where not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from deploy.live.known import known_record
from deploy.live.listener import Heard
from deploy.live.output import note
from messages.base import Message, WrongPayload, decoder
from messages.plain import plain, plain_record


class Reader:
    """Reads the samples of one topic; what is odd about one is noted once."""

    def __init__(self, name: str, expected: str) -> None:
        """``expected`` is the ROS type of samples that do not tell theirs; empty if nobody knows."""
        self._name, self._expected = name, expected
        self._decoders: dict[str, Callable[[bytes], Message] | None] = {}
        self._noted: set[str] = set()

    def read(self, heard: Heard) -> Any:
        """The message with all its fields; of an unknown type, or not of its own, as it is; None for no MessagePack."""
        type_name = heard.type or self._expected
        if heard.origin is None:
            self._note("a foreign sender, not of this project, publishes here: its samples have no number and no name")
        elif self._expected and heard.type and heard.type != self._expected:
            self._note(f"{heard.type} comes where {self._expected} is declared")
        decode = self._decoder(type_name)
        try:
            if decode is not None:
                return plain_record(decode(heard.payload))
        except WrongPayload as error:
            self._note(f"what comes is no {type_name}, readers refuse it; shown as it is ({error})")
        try:
            return plain(heard.payload)
        except WrongPayload as error:
            self._note(f"{len(heard.payload)} bytes that are not MessagePack are left out ({error})")
            return None

    def _decoder(self, type_name: str) -> Callable[[bytes], Message] | None:
        if type_name not in self._decoders:
            record = known_record(type_name)
            self._decoders[type_name] = decoder(record) if record is not None else None
            if record is None:
                said = f"the type {type_name} is not known here" if type_name else "nobody tells the type"
                self._note(f"{said}: shown as its MessagePack tells it")
        return self._decoders[type_name]

    def _note(self, text: str) -> None:
        if text not in self._noted and len(self._noted) < 20:
            self._noted.add(text)
            note(f"{self._name}: {text}")


def info(heard: Heard) -> dict[str, Any]:
    """What came beside the payload: type, number, sender's time [ns] and id, size; foreign without a number."""
    origin = heard.origin
    return {
        "type": heard.type,
        "foreign": origin is None,
        "sequence": None if origin is None else origin.sequence,
        "source_time": None if origin is None else origin.source_ns,
        "received_time": heard.arrived,
        "publisher": "" if origin is None else origin.publisher.hex(),
        "size": len(heard.payload),
        "lost_before": heard.lost,
    }
