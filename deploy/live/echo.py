"""Shows the messages of a topic as they arrive."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from deploy import INTERRUPTED
from deploy.interfaces import canonical_type, known_record, record_by_type
from deploy.live.connect import cli_node, spin
from deploy.live.learned_types import record_on_network
from deploy.live.message_format import MAX_ELEMENTS, csv_cells, csv_row, to_flow_yaml, to_yaml, truncate
from deploy.live.output import write_json, write_note, write_text
from deploy.live.topics import absolute_name, group_by_topic, is_latched, topic_type, wait_for_topic
from messages.base import Message, WrongPayload, decoder
from messages.plain import plain, plain_record
from services.runtime.errors import EleaError
from services.runtime.field_path import FieldPath, check_path, format_path, get_field, parse_path
from services.runtime.graph import snapshot
from services.runtime.light_node import LightNode
from services.runtime.network_address import NetworkAddress
from services.runtime.subscriber import ReceivedSample, UntypedSubscriber
from services.runtime.transport.api import Transport


class MessageReader:
    """Decodes the samples of one topic; reports each kind of problem once."""

    def __init__(self, name: str, expected: str, transport: Transport | None = None) -> None:
        """``expected`` is the ROS type of samples that do not state one; empty if unknown.

        Unknown types are learned from the nodes of ``transport``.
        """
        self._name, self._expected, self._transport = name, expected, transport
        self._decoders: dict[str, Callable[[bytes], Message] | None] = {}
        self._noted: set[str] = set()

    def read(self, sample: ReceivedSample) -> Any:
        """Return the message with all its fields; if its type is unknown or wrong, as decoded; None if it is not
        MessagePack.
        """
        type_name = sample.type or self._expected
        if sample.origin is None:
            self._note("an external program publishes here: its samples carry no number and no name")
        elif self._expected and sample.type and sample.type != self._expected:
            self._note(f"{sample.type} arrives where {self._expected} is declared")
        decode = self._decoder(type_name)
        try:
            if decode is not None:
                return plain_record(decode(sample.payload))
        except WrongPayload as error:
            self._note(f"the samples are not {type_name}: subscribers refuse them; shown as decoded ({error})")
        try:
            return plain(sample.payload)
        except WrongPayload as error:
            self._note(f"{len(sample.payload)} bytes that are not MessagePack are left out ({error})")
            return None

    def _decoder(self, type_name: str) -> Callable[[bytes], Message] | None:
        if type_name not in self._decoders:
            record = record_on_network(self._transport, type_name) if self._transport else known_record(type_name)
            self._decoders[type_name] = decoder(record) if record is not None else None
            if record is None:
                problem = f"unknown type {type_name}" if type_name else "undeclared type"
                self._note(f"{problem}: printed as decoded from MessagePack")
        return self._decoders[type_name]

    def _note(self, text: str) -> None:
        if text not in self._noted and len(self._noted) < 20:
            self._noted.add(text)
            write_note(f"{self._name}: {text}")


def sample_info(sample: ReceivedSample) -> dict[str, Any]:
    """Return metadata of a sample: type, number, the sender's time [ns] and id, size; foreign if it has no number."""
    origin = sample.origin
    return {
        "type": sample.type,
        "foreign": origin is None,
        "sequence": None if origin is None else origin.sequence,
        "source_time": None if origin is None else origin.source_ns,
        "received_time": sample.received_ns,
        "publisher": "" if origin is None else origin.publisher.hex(),
        "size": len(sample.payload),
        "lost_before": sample.lost,
    }


@dataclass(frozen=True)
class EchoRequest:
    """The messages to show: topic, type if the sender does not state it, fields, and number."""

    topic: str
    type_name: str = ""
    fields: tuple[str, ...] = ()
    count: int = 0
    timeout: float | None = None
    wait: bool = False


@dataclass(frozen=True)
class EchoFormat:
    """The output format."""

    as_json: bool = False
    as_csv: bool = False
    no_header: bool = False
    no_arr: bool = False
    no_str: bool = False
    full_length: bool = False
    max_elements: int | None = None
    flow_style: bool = False
    with_info: bool = False


def echo(address: NetworkAddress, asked: EchoRequest, style: EchoFormat) -> int:
    """Show messages until ``count`` or a signal; return the exit status. Raises EleaError if they do not arrive in
    time.
    """
    name, paths = absolute_name(asked.topic), [parse_path(each) for each in asked.fields]
    wanted = canonical_type(record_by_type(asked.type_name).ROS_TYPE) if asked.type_name else ""
    deadline = None if asked.timeout is None else time.monotonic() + asked.timeout
    with cli_node(address, "echo") as live:
        name, paths = _split_field(live, name, paths)
        ends = wait_for_topic(live, name, asked.wait)
        expected, latched = wanted or topic_type(ends), is_latched(ends)
        _check_fields(live, expected, paths)
        printer = _Printer(style, paths)
        listener, reader = (
            UntypedSubscriber(live.transport, name, latched),
            MessageReader(name, expected, live.transport),
        )
        live.declare_subscription(name, expected, "LATCHED" if latched else "SENSOR")
        left = None if deadline is None else max(0.0, deadline - time.monotonic())
        for _ in spin(live, listener.raw, left):
            for sample in listener.drain():
                printer.show(sample, reader.read(sample))
                if asked.count and printer.shown == asked.count:
                    return 0
        if listener.lost:
            write_note(f"{listener.lost} messages were lost: they arrive faster than they can be printed")
        if live.stopping:
            return INTERRUPTED if asked.count else 0
    if printer.shown and not asked.count:
        return 0
    raise EleaError(f"{printer.shown} messages arrived on {name} within {asked.timeout:g} s: is it being published?")


class _Printer:
    """Writes messages in the requested format."""

    def __init__(self, style: EchoFormat, paths: list[FieldPath]) -> None:
        self._style, self._paths = style, paths
        self._headed = style.no_header
        self.shown = 0
        untruncated = style.full_length or style.as_json or style.as_csv
        self._most = style.max_elements or (None if untruncated else MAX_ELEMENTS)

    def show(self, sample: ReceivedSample, value: Any) -> None:
        """Write one message, with its metadata if requested."""
        if value is None:
            return
        style = self._style
        value = self._part(value)
        if not style.as_json or style.no_arr or style.no_str or style.max_elements:
            value = truncate(value, self._most, not style.no_arr, not style.no_str)
        if style.with_info:
            value = {"info": sample_info(sample), "message": value}
        if style.as_json:
            write_json(value, lines=True)
        elif style.as_csv:
            self._row(value)
        else:
            write_text(to_flow_yaml(value) + "\n---\n" if style.flow_style else to_yaml(value) + "---\n", flush=True)
        self.shown += 1

    def _part(self, value: Any) -> Any:
        if not self._paths:
            return value
        if len(self._paths) == 1 and not self._style.as_csv:
            return get_field(value, self._paths[0])
        return {format_path(path): get_field(value, path) for path in self._paths}

    def _row(self, value: Any) -> None:
        columns = csv_cells(value)
        if not self._headed:
            self._headed = True
            write_text(csv_row([name for name, _ in columns]))
        write_text(csv_row([text for _, text in columns]), flush=True)


def _split_field(live: LightNode, name: str, paths: list[FieldPath]) -> tuple[str, list[FieldPath]]:
    """Split topic and field, which rostopic's users write as one: ``/tb3_0/odom/pose/pose/position``."""
    known = group_by_topic(snapshot(live.transport)) if not paths else {}
    if paths or name in known:
        return name, paths
    above = [each for each in known if name.startswith(f"{each}/")]
    longest = max(above, key=len, default="")
    record = record_on_network(live.transport, topic_type(known[longest])) if longest else None
    if record is None:
        return name, paths
    path = parse_path(name.removeprefix(f"{longest}/"))
    check_path(record, path)
    return longest, [path]


def _check_fields(live: LightNode, type_name: str, paths: list[FieldPath]) -> None:
    """Raise BadInput for fields that the type does not have, before any message arrives."""
    record = record_on_network(live.transport, type_name) if paths else None
    for path in paths if record is not None else ():
        assert record is not None
        check_path(record, path)
