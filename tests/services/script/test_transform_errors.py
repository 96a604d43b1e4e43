"""tf2's errors for a missing transform, word for word."""

from __future__ import annotations

from messages.geometry import TransformStamped
from messages.std import Header, Time
from services.runtime.errors import NoTransform
from services.runtime.tf.buffer import TransformBuffer
from services.script.transform_errors import described, explain

S = 10**9


def link(parent: str, child: str, seconds: float) -> TransformStamped:
    return TransformStamped(header=Header(stamp=Time.of(round(seconds * S)), frame_id=parent), child_frame_id=child)


def refused(buffer: TransformBuffer, target: str, source: str, seconds: float | None = None) -> tuple[str, str]:
    time = None if seconds is None else round(seconds * S)
    try:
        buffer.lookup(target, source, time)
    except NoTransform as error:
        return explain(buffer, error, target, source, time)
    raise AssertionError("there is a transform")


def test_the_reasons_are_those_of_tf2() -> None:
    buffer = TransformBuffer()
    moving = [link("a", "b", 10), link("a", "b", 11), link("c", "d", 11), link("b", "f", 20), link("b", "e", 10.5)]
    buffer.add(moving, b"")
    trees = (
        "Could not find a connection between 'b' and 'd' because they are not part of the same tree."
        "Tf has two or more unconnected trees."
    )
    assert refused(buffer, "b", "d") == ("connectivity", trees)
    assert refused(buffer, "b", "d", 11) == ("connectivity", trees)
    looking = ", when looking up transform from frame"
    into = "Lookup would require extrapolation"
    for target, source, at, reason in (
        ("a", "b", 12.5, f"{into} 1.500000000s into the future.  Requested time 12.500000000 but the latest data is at "
            "time 11.000000000"),
        ("b", "a", 8, f"{into} 2.000000000s into the past.  Requested time 8.000000000 but the earliest data is at "
            "time 10.000000000"),
        ("b", "d", 5, f"{into} 5.000000000s into the past.  Requested time 5.000000000 but the earliest data is at "
            "time 10.000000000"),
        ("a", "f", None, f"{into} at time 11.000000000, but only time 20.000000000 is in the buffer"),
        ("f", "e", None, f"{into} at time 10.500000000, but only time 20.000000000 is in the buffer"),
    ):  # fmt: skip
        wanted = f"{reason}{looking} [{source}] to frame [{target}]"
        assert refused(buffer, target, source, at) == ("extrapolation", wanted), (target, source, at)


def test_long_times_cut_the_sentence_as_in_tf2() -> None:
    buffer = TransformBuffer()
    buffer.add([link("a", "b", 1795342798)], b"")
    assert refused(buffer, "a", "b", 1795342803)[1].endswith(
        "but only time 1795342798.000000000 is in the buffe, when looking up transform from frame [b] to frame [a]"
    )


def test_a_loop_lists_the_frames() -> None:
    buffer = TransformBuffer()
    buffer.add([link("x", "y", 1), link("y", "x", 1), link("world", "z", 1)], b"")
    lines = "Frame x exists with parent y.\nFrame y exists with parent x.\nFrame z exists with parent world.\n"
    assert refused(buffer, "x", "z") == ("lookup", f"The tf tree is invalid because it contains a loop.\n{lines}\n")
    assert described(buffer, ["z", "world"]) == "Frame z exists with parent world.\n"
