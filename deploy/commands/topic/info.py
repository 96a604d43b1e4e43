"""``elea topic info``: who publishes and who subscribes to a topic."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from deploy.commands.options import json_option, place_options
from deploy.commands.topic.shared import topic_argument
from deploy.place import Place

if TYPE_CHECKING:
    from deploy.live.ends import Ends
    from deploy.live.session import Session

_LISTEN_S = 1.2
"""Wall time that a rate is measured, and heartbeats are awaited, which come once a second."""

_COUNTS = ("received", "lost", "refused", "repeated", "resynced", "foreign")


@click.command("info")
@topic_argument
@click.option("-v", "--verbose", is_flag=True, help="Listen for a second: nodes, qualities, rates, losses, foreigners.")
@place_options
@json_option
def command(topic: str, verbose: bool, place: Place, as_json: bool) -> None:
    """Tell type, publishers and subscribers of TOPIC."""
    from deploy.live.ends import absolute
    from deploy.live.output import say, say_json
    from deploy.live.session import session
    from deploy.live.subject import find_subject

    name = absolute(topic)
    with session(place, "info") as live:
        told = _told(find_subject(live, name), live, verbose)
    if as_json:
        say_json(told)
    else:
        say(_text(told, verbose))


def _told(ends: Ends, live: Session, verbose: bool) -> dict[str, Any]:
    from deploy.live.known import topic_of

    known = topic_of(ends.name)
    told: dict[str, Any] = {
        "topic": ends.name,
        "types": list(ends.types),
        "quality": next((each.detail.lower() for each in (*ends.publishers, *ends.subscribers)), None),
        "promised": known.rate if known is not None and known.rate else None,
        "about": known.about if known is not None else "",
        "publishers": [
            {"node": each.node, "type": each.record, "quality": each.detail.lower()} for each in ends.publishers
        ],
        "subscribers": [
            {"node": each.node, "type": each.record, "quality": each.detail.lower()} for each in ends.subscribers
        ],
    }
    if verbose:
        _listen(told, ends, live)
    return told


def _listen(told: dict[str, Any], ends: Ends, live: Session) -> None:
    """Add what a second of listening shows: each publisher's rate, and what the ends say in their heartbeats."""
    from deploy.live.beats import Beats
    from deploy.live.clock import SimClock
    from deploy.live.listener import Listener
    from deploy.live.rates import Sample, Window
    from deploy.live.subject import is_latched
    from messages.names import key as key_of
    from services.runtime.network.wire import MEMBER_BYTES, member_id, publisher_id

    beats, clock = Beats(live), SimClock(live.transport)
    listener, foreign = Listener(live.transport, ends.name, is_latched(ends)), list[str]()
    windows: dict[bytes, Window] = {}
    for _ in live.turns(listener.inlet, _LISTEN_S):
        beats.follow()
        clock.follow()
        for heard in listener.take():
            sender = b"" if heard.origin is None else heard.origin.publisher
            sample = Sample(clock.time_of(heard), heard.sent, heard.lost, len(heard.payload))
            windows.setdefault(sender, Window(100_000)).add(sample)
            if not sender and (heard.type or "?") not in foreign:
                foreign.append(heard.type or "?")
    for row, entity in zip(told["publishers"], ends.publishers, strict=True):
        window = windows.pop(publisher_id(entity.node, entity.session, key_of(entity.name)), None)
        row |= _rates(window)
        row["sent"] = getattr(beats.outputs(entity.node).get(ends.name), "sent", None)
    members = {member_id(each.node, each.session): each.node for each in ends.publishers}
    for sender, window in windows.items():
        kind = ", ".join(foreign) if not sender else "?"
        # A node that plays what several nodes had latched is each of them in turn.
        again = members.get(sender[:MEMBER_BYTES])
        who = "(foreign)" if not sender else again or f"(undeclared {sender.hex()})"
        told["publishers"].append({"node": who, "type": kind, "quality": "-", **_rates(window), "sent": None})
    for row in told["subscribers"]:
        row["beats"] = row["node"] in beats.of
        own = beats.inputs(row["node"]).get(ends.name)
        for name in (*_COUNTS, "reason"):
            row[name] = getattr(own, name, None)


def _rates(window: Any) -> dict[str, Any]:
    simulated, wall = (None, None) if window is None else (window.simulated(), window.wall())
    return {
        "hz": None if simulated is None else simulated.hz,
        "wall_hz": None if wall is None else wall.hz,
        "lost": 0 if window is None else window.lost,
    }


def _text(told: dict[str, Any], verbose: bool) -> str:
    publishers, subscribers = told["publishers"], told["subscribers"]
    lines = [f"Type: {', '.join(told['types']) or '?'}"]
    if told["about"]:
        lines.append(f"About: {told['about']}")
    lines.append(f"Quality: {told['quality'] or '?'}")
    if told["promised"]:
        lines.append(f"Promised rate: {told['promised']:g} Hz")
    lines.append(f"Publisher count: {len(publishers)}")
    lines += [_publisher(each) for each in publishers if verbose]
    lines.append(f"Subscription count: {len(subscribers)}")
    lines += [_subscriber(each) for each in subscribers if verbose]
    return "\n".join(lines) + "\n"


def _publisher(row: dict[str, Any]) -> str:
    heard = "silent for a second" if row["wall_hz"] is None else f"{row['wall_hz']:.1f} Hz by the wall clock"
    heard += "" if row["hz"] is None else f", {row['hz']:.1f} Hz simulated"
    sent = "" if row["sent"] is None else f", sent {row['sent']}"
    lost = f", {row['lost']} lost on the way here" if row["lost"] else ""
    return f"  {row['node']}  [{row['type']}, {row['quality']}]  {heard}{sent}{lost}"


def _subscriber(row: dict[str, Any]) -> str:
    if row["received"] is None:
        from deploy.live.ends import is_hidden

        silent = "a passing tool" if is_hidden(row["node"]) else "no heartbeat for a second"
        if row["beats"]:
            silent = f"it reads so many topics that this one's turn did not come: ./elea node info {row['node']}"
        return f"  {row['node']}  [{row['type']}, {row['quality']}]  {silent}"
    shown = [name for name in _COUNTS if row[name] or name not in ("repeated", "resynced")]
    counts = ", ".join(f"{name} {row[name]}" for name in shown)
    reason = f" ({row['reason']})" if row["reason"] else ""
    return f"  {row['node']}  [{row['type']}, {row['quality']}]  {counts}{reason}"
