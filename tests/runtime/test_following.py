"""A node follows its set of parameters: at its start, at a tick, and whatever becomes of the parameter service."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Annotated, Any, Literal

import pytest
from msgspec import Meta

from messages.base import encode
from messages.parameters import ParameterValues
from messages.requests import PARAMS_ANNOUNCE
from messages.topics import UPDATES, Quality
from services.runtime.context import Context
from services.runtime.errors import BadInput, CallFailed
from services.runtime.followed import Followed
from services.runtime.following import START_S
from services.runtime.graph import Entity
from services.runtime.memory_transport import MemoryBus, MemoryTransport
from services.runtime.node import Node
from services.runtime.parameters import ALL
from services.runtime.service import Parameters
from services.runtime.wire import encoding
from tests.runtime.authority import Authority, told
from tests.runtime.bench import HandClock, node
from tests.waiting import until

MS = 1_000_000
SET = "/tb3_0/pilot"


class Gains(Parameters, frozen=True, kw_only=True):
    p: Annotated[float, Meta(ge=0, le=5)] = 1.0
    d: Annotated[float, Meta(ge=0, le=5, extra={"level": 4})] = 0.1
    law: Annotated[Literal["pd", "pid"], Meta(extra={"level": 2})] = "pd"
    points: tuple[tuple[float, float], ...] = ()
    file: Annotated[str, Meta(extra={"live": False})] = "a"


@contextmanager
def pilot(bus: MemoryBus, **options: Any) -> Iterator[tuple[Node, Followed[Gains]]]:
    with MemoryTransport(bus) as transport, node(bus, "pilot", "/tb3_0", transport) as made:
        yield made, Followed(made, SET, options.pop("params", Gains()), **options)


def follow(made: Node, followed: Followed[Gains]) -> int:
    """One look, as a tick takes it."""
    made.turn()
    followed.admit()
    return followed.refresh()


def log_of(made: Node) -> str:
    assert made.log._out is not None
    return made.log._out.getvalue()  # type: ignore[attr-defined]


def refused(made: Node) -> int:
    return sum(each.refused for each in made.inputs if each.topic is UPDATES)


def test_a_node_starts_on_what_the_parameter_service_says(bus: MemoryBus) -> None:
    with Authority(bus, lambda asked: told(asked.set, {"p": 2, "law": "pid", "file": "b", "stranger": 1})) as params:
        given = {"fleet": {"d": 0.2}, "command_line": {"file": "a"}}
        with pilot(bus, params=Gains(d=0.2), **given) as (made, followed):
            followed.begin()
            assert followed.params == Gains(p=2.0, law="pid", d=0.2, file="a")
            assert followed.origins["p"] == "saved"
            assert f"parameters {SET}: p = 2.0 (saved), law = pid (saved)" in log_of(made)
    (asked,) = params.announced
    assert (asked.set, asked.node) == (SET, "/tb3_0/pilot")
    assert [each.name for each in asked.parameters] == ["p", "d", "law", "points", "file"]
    assert [(each.name, each.value) for each in asked.fleet] == [("d", 0.2)]
    assert [(each.name, each.value) for each in asked.command_line] == [("file", "a")]


def test_a_change_counts_whole_with_the_levels_of_what_changed(bus: MemoryBus) -> None:
    with Authority(bus) as params, pilot(bus) as (made, followed):
        followed.begin()
        assert follow(made, followed) == 0
        params.publish(SET, {"p": 3.0, "d": 0.1, "law": "pid", "points": ((1, 2), (3, 4)), "file": "b"})
        assert follow(made, followed) == 1 | 2
        assert followed.params == Gains(p=3.0, law="pid", points=((1.0, 2.0), (3.0, 4.0)))
        params.publish(SET, {"p": 3.0, "d": 0.5})
        assert follow(made, followed) == 4
        assert follow(made, followed) == 0


@pytest.mark.parametrize(
    "values",
    [
        {"p": 9.0, "d": 1.0},
        {"p": "much", "d": 1.0},
        {"law": "bang", "d": 1.0},
        {"points": ((1.0, 2.0, 3.0),), "d": 1.0},
        {"p": None, "d": 1.0},
    ],
)
def test_a_change_that_does_not_fit_is_refused_whole_and_taken_back(bus: MemoryBus, values: dict[str, Any]) -> None:
    with Authority(bus) as params, pilot(bus) as (made, followed):
        followed.begin()
        params.publish(SET, values)
        assert follow(made, followed) == 0
        assert followed.params == Gains()
        assert refused(made) == 1
        assert f"a change of the parameters {SET} is refused" in log_of(made)
        until(lambda: params.undone)
        assert params.undone[0].set == SET
        assert "/tb3_0/pilot" in params.undone[0].who
        params.publish(SET, {"d": 1.0})
        assert follow(made, followed) == 4


def test_values_that_contradict_each_other_are_refused(bus: MemoryBus) -> None:
    def fits(gains: Gains) -> None:
        if gains.d > gains.p:
            raise BadInput(f"d = {gains.d:g} above p = {gains.p:g} rings")

    with Authority(bus) as params, pilot(bus, fits=fits) as (made, followed):
        followed.begin()
        params.publish(SET, {"p": 0.5, "d": 1.0})
        assert follow(made, followed) == 0
        params.publish(SET, {"p": 0.4, "d": 1.0})
        assert follow(made, followed) == 0
        until(lambda: params.undone)
        assert "rings" in params.undone[0].who
        # Once is enough until something fits again, lest two of them wander through the history.
        assert len(params.undone) == 1
        with pytest.raises(BadInput, match="rings"):
            followed.change({"d": 2.0})


def test_saved_values_that_contradict_each_other_are_left_for_a_person_to_mend(
    bus: MemoryBus,
) -> None:
    def fits(gains: Gains) -> None:
        if gains.d > gains.p:
            raise BadInput("it rings")

    bad = {"p": 0.1, "d": 1.0}
    with Authority(bus, lambda asked: told(asked.set, bad)) as params, pilot(bus, fits=fits) as (made, followed):
        followed.begin()
        params.publish(SET, bad)
        assert follow(made, followed) == 0
        assert followed.params == Gains()
        assert f"./elea param reset {SET} forgets what was saved" in log_of(made)
        for _ in range(5):
            made.turn()
        assert params.undone == []


def test_only_the_parameter_service_changes_parameters(bus: MemoryBus) -> None:
    with Authority(bus) as params, pilot(bus) as (made, followed), node(bus, "stranger") as stranger:
        followed.begin()
        stranger.write(UPDATES, f"{SET}/parameter_updates").publish(told(SET, {"p": 2.0}))
        bare = MemoryTransport(bus).publish(
            SET[1:] + "/parameter_updates", encoding(ParameterValues.ROS_TYPE), Quality.LATCHED
        )
        bare.put(encode(told(SET, {"p": 2.5})), attachment=b"")
        assert follow(made, followed) == 0
        assert (followed.params, refused(made), params.undone) == (Gains(), 2, [])
        (updates,) = (each for each in made.inputs if each.topic is UPDATES)
        assert updates.health().reason == "not from the node /params, which alone may publish it"


def test_without_a_parameter_service_a_node_says_so_once_and_follows_it_when_it_comes(bus: MemoryBus) -> None:
    with pilot(bus, params=Gains(p=1.5), fleet={"p": 1.5}) as (made, followed):
        began = time.monotonic()
        followed.begin()
        assert time.monotonic() - began < 0.5
        for _ in range(20):
            follow(made, followed)
        assert log_of(made).count("no parameter service is there") == 1
        assert followed.params == Gains(p=1.5)
        with Authority(bus, lambda asked: told(asked.set, {"p": 4.0})) as params:
            until(lambda: follow(made, followed))
            assert followed.params == Gains(p=4.0)
            assert [(each.name, each.value) for each in params.announced[0].fleet] == [("p", 1.5)]
            params.publish(SET, {"p": 4.5, "d": 3.0}, "run")
            assert follow(made, followed)
        until(lambda: made.turn() or "the parameter service is gone" in log_of(made))
        assert followed.params == Gains(p=4.5, d=3.0)
        with Authority(bus, lambda asked: told(asked.set, {"p": 4.0, "d": 3.0})) as again:
            until(lambda: follow(made, followed))
            assert followed.params == Gains(p=4.0, d=3.0)
            assert {each.name: each.value for each in again.announced[0].run} == {"p": 4.5, "d": 3.0}


def test_no_answer_a_bad_one_and_a_refusal_leave_a_node_on_its_own_values(bus: MemoryBus) -> None:
    def refuse(_: Any) -> ParameterValues:
        raise BadInput("no more sets are taken")

    with Authority(bus, refuse), pilot(bus) as (made, followed):
        followed.begin()
        assert "no more sets are taken" in log_of(made)
        assert followed.params == Gains()
    transport = MemoryTransport(bus)
    with node(bus, "params", transport=transport) as mute, pilot(bus) as (made, followed):
        mute.serve(PARAMS_ANNOUNCE, lambda _: told(SET, {}))
        began = time.monotonic()
        followed.begin()
        assert START_S - 0.1 < time.monotonic() - began < START_S + 1.0
        assert "did not answer" in log_of(made)
        made.turn()
        (query,) = list(mute.served[0]._server.queries)  # type: ignore[attr-defined]
        query.reply(b"\xc1 nonsense")
        assert follow(made, followed) == 0
    assert followed.params == Gains()


def test_a_service_that_is_expected_is_asked_until_its_link_carries_a_question(bus: MemoryBus) -> None:
    """Its token may be seen, while links come up, before anything that is asked of it arrives."""
    with MemoryTransport(bus) as early, pilot(bus) as (made, followed), ExitStack() as late:
        early.token(Entity(early.session, "srv", "/params", PARAMS_ANNOUNCE.name).key)
        made.expects_params = True
        come = threading.Timer(0.2, lambda: late.enter_context(Authority(bus, lambda asked: told(asked.set, {"p": 2}))))
        come.start()
        followed.begin()
        come.join(10)
        assert followed.params == Gains(p=2.0)
        assert "own for now" not in log_of(made)


def test_a_node_changes_its_own_parameters_through_the_service_that_owns_them(bus: MemoryBus) -> None:
    with pilot(bus) as (made, followed):
        followed.begin()
        followed.change({"p": 2.0})
        assert (followed.params.p, followed.origins["p"], followed.run_values) == (2.0, "run", {"p": 2.0})
        for bad, says in (({"p": 9.0}, "p = 9"), ({"q": 1.0}, "unknown parameter 'q'")):
            with pytest.raises(BadInput, match=says):
                followed.change(bad)
        with Authority(bus) as params:
            until(lambda: made.turn() or params.announced)
            followed.change({"p": 3.0})
            assert followed.params.p == 3.0
            assert (params.asked[0].run, params.asked[0].who) == (True, "/tb3_0/pilot")
            params.publish(SET, {"p": 3.5})
            assert follow(made, followed)
        assert followed.params.p == 3.5


def test_a_loop_sees_the_record_of_its_tick(bus: MemoryBus, clock: HandClock) -> None:
    seen: list[tuple[int, float, int]] = []
    with Authority(bus) as params, pilot(bus) as (made, followed):
        followed.begin()
        ctx: Context[Gains] = Context(made, followed.params, 25, followed=followed)
        ticks = ctx.ticks()

        def step() -> None:
            seen.append((next(ticks).time, ctx.params.p, ctx.params_changed))

        first = threading.Thread(target=step)
        first.start()
        until(lambda: any(each.pattern == "clock" for each in bus.inlets))
        for time_ns in (0, 40 * MS, 80 * MS, 120 * MS):
            clock.tell(time_ns)
            if time_ns:
                step()
            first.join(10)
            if time_ns == 40 * MS:
                params.publish(SET, {"p": 2.0})
                assert ctx.params.p == 1.0
    assert seen == [(0, 1.0, ALL), (40 * MS, 1.0, 0), (80 * MS, 2.0, 1), (120 * MS, 2.0, 0)]


def test_a_loop_without_ticks_follows_too(bus: MemoryBus) -> None:
    with Authority(bus) as params, pilot(bus) as (made, followed):
        followed.begin()
        ctx: Context[Gains] = Context(made, followed.params, None, followed=followed)
        params.publish(SET, {"p": 2.0})
        until(lambda: ctx.idle() or ctx.params.p == 2.0)
        params.publish(SET, {"p": 2.5, "d": 2.0})
        assert ctx.follow() == 1 | 4
        assert ctx.params == Gains(p=2.5, d=2.0)


def test_what_is_overtaken_does_not_count(bus: MemoryBus) -> None:
    with Authority(bus) as params, pilot(bus) as (made, followed):
        followed.begin()
        params.publish(SET, {"p": 2.0})  # revision 2
        followed.change({"p": 3.0})  # revision 3, by its answer
        follow(made, followed)
        assert followed.params.p == 3.0


def test_an_answer_that_says_no_is_told_to_who_asked(bus: MemoryBus) -> None:
    with Authority(bus) as params, pilot(bus) as (made, followed):
        followed.begin()
        until(lambda: made.turn() or params.announced)

        def refuse(_: Any) -> ParameterValues:
            raise BadInput("not today")

        next(each for each in params._node.served if each.request.name == "/params/set")._handler = refuse
        with pytest.raises(CallFailed, match="not today"):
            followed.change({"p": 3.0})
        assert followed.params == Gains()
