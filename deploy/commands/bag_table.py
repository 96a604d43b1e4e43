"""What a bag holds, as a table on the terminal."""

from __future__ import annotations

from datetime import datetime

from services.bag.info import BagInfo


def show(info: BagInfo) -> None:
    """Print it."""
    from rich.console import Console
    from rich.table import Table

    console = Console(soft_wrap=True)
    begun = datetime.fromtimestamp(info.start).astimezone().isoformat(sep=" ", timespec="seconds")
    console.print(
        f"{info.path}: {_size(info.bytes)} in {len(info.files)} {'file' if len(info.files) == 1 else 'files'}"
    )
    console.print(
        f"{info.messages} messages in {info.seconds:.2f} s simulated, {info.wall_seconds:.2f} s on the wall, "
        f"from {begun}"
    )
    table = Table(box=None, pad_edge=False)
    for name in ("topic", "type"):
        table.add_column(name, no_wrap=True)
    for name in ("messages", "Hz"):
        table.add_column(name, justify="right")
    table.add_column("")
    for each in info.topics:
        rate = "" if each.rate is None else f"{each.rate:.2f}"
        notes = ["latched"] if each.latched else []
        notes += [] if each.playable else [f"cannot be played: {each.reason}"]
        table.add_row(each.topic, each.type, str(each.messages), rate, ", ".join(notes))
    console.print(table)
    if len(info.files) > 1:
        console.print("files: " + ", ".join(f"{each.name} ({_size(each.bytes)})" for each in info.files))
    for topic, count in info.lost.items():
        console.print(f"lost on their way to the recorder: {count} messages of {topic}")
    if info.unwritten:
        console.print(f"not taken by the disk: {info.unwritten} messages")


def _size(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 10**6 else f"{count / 1e3:.1f} kB"
