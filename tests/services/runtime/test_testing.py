"""The harness for users' tests: inputs, simulated time, parameters, outputs, and clear errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from messages.topics import ROSOUT
from services.runtime import CMD_VEL, GOAL_POSE, ODOM, BadInput, Context, Odometry, Parameters, Service, Twist, param
from services.runtime.testing import run_service


class Speed(Parameters):
    speed: float = param(0.2, 0.0, 0.5, "m/s", "Top speed.")


def follow(ctx: Context[Speed]) -> None:
    odom, others = ctx.latest(ODOM), ctx.stream(ODOM.of("tb3_1"))
    for tick in ctx.ticks():
        if odom.fresh(0.5) is not None:
            ctx.publish(CMD_VEL, Twist.planar(ctx.params.speed, float(len(others.drain()))))
        if tick.reset:
            ctx.log.info(f"a reset at {tick.time / 1e9:g} s")


FOLLOWER = Service(name="follower", about="Follows.", run=follow, rate=25, parameters=Speed)


def test_a_tick_sees_what_was_published_before_it() -> None:
    with run_service(FOLLOWER, "/tb3_0", {"speed": 0.3}) as service:
        for _ in range(3):
            service.publish(ODOM.of("tb3_1"), Odometry())
        service.publish(ODOM, Odometry())
        service.set_time(0.0)
        assert service.next(CMD_VEL) == Twist.planar(0.3, 3.0)
        service.set_time(0.04)
        assert service.next(CMD_VEL) == Twist.planar(0.3, 0.0)
        assert service.drain(CMD_VEL) == []
        assert service.reads(ODOM)
        assert not service.reads(GOAL_POSE)
        service.set_time(0.0, epoch=1)
        assert "a reset at 0 s" in service.log
        service.set_time(0.04, epoch=1)
        assert service.drain(CMD_VEL) == [], "what came before a reset is forgotten"


def test_no_tick_is_passed_over() -> None:
    with run_service(FOLLOWER, "/tb3_0") as service:
        service.publish(ODOM, Odometry())
        for step in range(10):
            service.set_time(step / 25)
        assert len(service.drain(CMD_VEL)) == 10


def test_a_loop_alone_with_its_rate_runs_too_and_may_end() -> None:
    def once(ctx: Context[Any]) -> None:
        next(iter(ctx.ticks()))
        ctx.publish(CMD_VEL, Twist.planar(0.1, 0.0))

    with run_service(once, rate=25) as service:
        service.set_time(0.0)
        service.wait_end()
        assert service.next(CMD_VEL).linear.x == 0.1
        with pytest.raises(AssertionError, match="the service has ended, and there is nothing on /cmd_vel"):
            service.next(CMD_VEL)


def test_what_does_not_come_is_said_with_the_log() -> None:
    with run_service(FOLLOWER, "/tb3_0") as service:
        service.set_time(0.0)
        with pytest.raises(AssertionError, match=r"nothing on /tb3_0/cmd_vel for 0\.1 s"):
            service.next(CMD_VEL, within=0.1)


def test_what_the_loop_raises_is_raised() -> None:
    def fail(ctx: Context[Any]) -> None:
        for _ in ctx.ticks():
            raise ZeroDivisionError("a bug")

    def play() -> None:
        with run_service(fail, rate=25) as service:
            service.set_time(0.0)

    with pytest.raises(ZeroDivisionError, match="a bug"):
        play()


def test_any_value_can_be_logged() -> None:
    def talk(ctx: Context[Any]) -> None:
        for tick in ctx.ticks():
            for each in (Path("/map.yaml"), 3.5, {"a": 1}, "bad \udcff", "é" * 100_000, tick.reset):
                ctx.log.info(each)

    with run_service(talk, rate=25) as service:
        service.set_time(0.04)
        said = [each.msg for each in service.drain(ROSOUT)]
        assert service.running
        assert "é" * 100_000 in service.log, "the line on stderr is whole"
        assert "bad \udcff" in service.log
    assert said[:4] == ["/map.yaml", "3.5", "{'a': 1}", "bad ?"]
    assert said[4] == "é" * 9_999 + "…"
    assert said[5] == "False"


WITH_STATE = """
from services.runtime import Service, main

seen = []


def run(ctx):
    for tick in ctx.ticks():
        import beside_it
        seen.append(tick)
        ctx.log.info(f"tick {len(seen)} of {beside_it.NAME}")


main(Service(name="mine", about="Mine.", run=run, rate=25))
"""


def test_a_file_starts_afresh_and_imports_from_its_folder_in_its_loop(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(WITH_STATE)
    (tmp_path / "beside_it.py").write_text('NAME = "mine"\n')
    for _ in range(2):
        with run_service(tmp_path / "mine.py") as service:
            service.set_time(0.04)
            assert [each.msg for each in service.drain(ROSOUT)] == ["tick 1 of mine"]


def test_parameters_out_of_bounds_and_files_without_a_service_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="speed"), run_service(FOLLOWER, params={"speed": 3}):
        pass
    with pytest.raises(BadInput, match="there is no file"), run_service(tmp_path / "gone.py"):
        pass
