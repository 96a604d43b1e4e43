"""What a bag holds, as a table: whole lines, on a terminal as in a pipe, however long they are."""

from __future__ import annotations

from datetime import datetime

from deploy.live.output import say
from deploy.live.text import printable
from services.bag.info import BagInfo, TopicInfo


def show(info: BagInfo) -> None:
    """Print it."""
    begun = datetime.fromtimestamp(info.start).astimezone().isoformat(sep=" ", timespec="seconds")
    files = f"{len(info.files)} {'file' if len(info.files) == 1 else 'files'}"
    lines = [
        f"{info.path}: {_size(info.bytes)} in {files}",
        f"{info.messages} messages in {info.seconds:.2f} s simulated, {info.wall_seconds:.2f} s on the wall, "
        f"from {begun}",
        *_columns([("topic", "type", "messages", "Hz", ""), *map(_row, info.topics)]),
    ]
    if len(info.files) > 1:
        lines.append("files: " + ", ".join(f"{each.name} ({_size(each.bytes)})" for each in info.files))
    lines += [f"lost on their way to the recorder: {count} messages of {topic}" for topic, count in info.lost.items()]
    if info.unwritten:
        lines.append(f"not taken by the disk: {info.unwritten} messages")
    say("".join(f"{printable(line)}\n" for line in lines))


def _row(topic: TopicInfo) -> tuple[str, ...]:
    rate = "" if topic.rate is None else f"{topic.rate:.2f}"
    notes = ["latched"] if topic.latched else []
    notes += [] if topic.playable else [f"cannot be played: {topic.reason}"]
    return topic.topic, topic.type, str(topic.messages), rate, ", ".join(notes)


def _columns(rows: list[tuple[str, ...]]) -> list[str]:
    """Names to the left, numbers to the right, notes as they are."""
    topic, kind, messages, rate, _ = (max(map(len, column)) for column in zip(*rows, strict=True))
    return [
        f"{each[0]:{topic}}  {each[1]:{kind}}  {each[2]:>{messages}}  {each[3]:>{rate}}  {each[4]}".rstrip()
        for each in rows
    ]


def _size(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 10**6 else f"{count / 1e3:.1f} kB"
