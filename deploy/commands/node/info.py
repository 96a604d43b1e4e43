"""``elea node info``: what a node publishes, subscribes and serves, and how it is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from deploy.commands.completion import NODE
from deploy.commands.options import json_option, place_options
from deploy.place import Place

if TYPE_CHECKING:
    from deploy.live.beats import Beats
    from services.runtime.graph import Entity


@click.command("info")
@click.argument("node", type=NODE)
@place_options
@json_option
def command(node: str, place: Place, as_json: bool) -> None:
    """Tell what NODE publishes, subscribes and serves; its heartbeat, which comes once a second, tells how it is."""
    from deploy.live.beats import hear
    from deploy.live.ends import absent, absolute
    from deploy.live.output import say, say_json
    from deploy.live.session import session
    from services.runtime.graph import snapshot

    name = absolute(node)
    with session(place, "info") as live:
        graph = snapshot(live.transport)
        own = [each for each in graph if each.node == name]
        if not own:
            raise absent(
                "node", name, {each.node for each in graph if each.node != live.node}, "./elea node list tells them all"
            )
        told = _told(name, own, hear(live, [name]))
    if as_json:
        say_json(told)
    else:
        say(_text(told))


_COUNTS = ("received", "lost", "refused", "repeated", "resynced", "foreign")


def _told(name: str, own: list[Entity], beats: Beats) -> dict[str, Any]:
    beat, inputs = beats.of.get(name), beats.inputs(name)
    sent = {topic: each.sent for topic, each in beats.outputs(name).items()}
    period = next((int(each.detail) for each in own if each.kind == "step"), None)
    return {
        "node": name,
        "kind": next((each.name for each in own if each.kind == "node"), ""),
        "lockstep_period_s": None if period is None else period / 1e9,
        "health": None
        if beat is None
        else {"state": beat.state, "note": beat.note, "pid": beat.pid, "beat": beat.beat, "ticks": beat.ticks}
        | {name: getattr(beat, name) for name in (*_COUNTS, "sent")},
        "publishers": [
            {"topic": each.name, "type": each.record, "quality": each.detail.lower(), "sent": sent.get(each.name)}
            for each in own
            if each.kind == "pub"
        ],
        "subscribers": [
            {"topic": each.name, "type": each.record, "quality": each.detail.lower()}
            | {name: getattr(inputs.get(each.name), name, None) for name in _COUNTS}
            | {"reason": getattr(inputs.get(each.name), "reason", "")}
            for each in own
            if each.kind == "sub"
        ],
        "services": [{"name": each.name, "type": each.record} for each in own if each.kind == "srv"],
    }


def _text(told: dict[str, Any]) -> str:
    lines = [f"{told['node']}  ({told['kind']})"]
    health = told["health"]
    if health is None:
        lines.append("  no heartbeat: it is a tool or a foreign program, or its loop is stuck")
    else:
        note = f" ({health['note']})" if health["note"] else ""
        lines.append(f"  {health['state']}{note}, pid {health['pid']}, {health['ticks']} ticks")
        lines.append(f"  in all:{_counts(health | {'reason': ''})}, sent {health['sent']}")
    if told["lockstep_period_s"] is not None:
        lines.append(f"  steps with the simulation every {told['lockstep_period_s']:g} s")
    lines.append("  Subscribers:")
    lines += [f"    {each['topic']}: {each['type']}{_counts(each)}" for each in told["subscribers"]]
    lines.append("  Publishers:")
    for each in told["publishers"]:
        sent = "" if each["sent"] is None else f"  sent {each['sent']}"
        lines.append(f"    {each['topic']}: {each['type']}{sent}")
    lines.append("  Service Servers:")
    lines += [f"    {each['name']}: {each['type']}" for each in told["services"]]
    return "\n".join(lines) + "\n"


def _counts(row: dict[str, Any]) -> str:
    if row["received"] is None:
        return ""
    odd = ", ".join(f"{name} {row[name]}" for name in _COUNTS[1:] if row[name])
    reason = f" ({row['reason']})" if row["reason"] else ""
    return f"  received {row['received']}{f', {odd}' if odd else ''}{reason}"
