"""A terminal's bytes: plain keys, and everything else, which must never drive a robot."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.teleop.keys import MOVES, SCALES
from services.teleop.terminal import ARROWS, ESCAPE_TIMEOUT_S, KeyDecoder

SPECIAL = {
    "F1": b"\x1bOP",
    "F5": b"\x1b[15~",
    "shift up": b"\x1b[1;2A",
    "delete": b"\x1b[3~",
    "paste": b"\x1b[200~",
    "alt i": b"\x1bi",
    "focus": b"\x1b[I",
    "mouse": b"\x1b[<0;12;7M",
    "report": b"\x1b[12;40R",
}


def keys(*pieces: bytes, pause: float = 0.001) -> list[str]:
    decoder = KeyDecoder()
    return [each.key for n, piece in enumerate(pieces) for each in decoder.feed(piece, 10.0 + n * pause)]


def test_plain_keys_are_themselves() -> None:
    assert keys(b"ijkl,.<> ") == list("ijkl,.<> ")


def test_they_carry_the_time_at_which_they_were_read() -> None:
    assert [each.time for each in KeyDecoder().feed(b"ii", 3.5)] == [3.5, 3.5]


@pytest.mark.parametrize("name", SPECIAL)
def test_a_special_key_is_one_other_key(name: str) -> None:
    assert keys(SPECIAL[name]) == ["other"]
    assert keys(SPECIAL[name] + b"i") == ["other", "i"]


@pytest.mark.parametrize("name", SPECIAL)
def test_however_a_special_key_is_cut_it_is_one_other_key(name: str) -> None:
    assert keys(*(bytes([byte]) for byte in SPECIAL[name])) == ["other"]


def test_an_arrow_key_that_comes_whole_is_that_key_and_one_that_is_cut_stops() -> None:
    assert keys(b"\x1b[A\x1b[B\x1b[C\x1b[Di") == ["up", "down", "right", "left", "i"]
    assert keys(b"\x1bOA\x1bOB\x1bOC\x1bOD") == ["up", "down", "right", "left"]
    for cut in (1, 2):
        assert keys(b"\x1b[A"[:cut], b"\x1b[A"[cut:]) == ["other"]
    assert keys(b"\x1b[1;2A") == ["other"], "with shift"


def test_an_escape_stops_at_once_and_what_is_typed_later_is_not_part_of_it() -> None:
    assert keys(b"\x1b", b"O", pause=2 * ESCAPE_TIMEOUT_S) == ["other", "O"]


def test_control_keys_and_letters_beyond_ascii_are_other_keys() -> None:
    assert keys(b"\x1a\x03\r\t\x7f") == ["other"] * 5
    assert set(keys("öß€".encode())) == {"other"}


@given(st.lists(st.sampled_from(sorted(SPECIAL)), max_size=6), st.data())
def test_no_cut_of_special_keys_drives(names: list[str], data: st.DataObject) -> None:
    whole = b"".join(SPECIAL[name] for name in names)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(whole)), max_size=4)))
    pieces = [whole[a:b] for a, b in zip([0, *cuts], [*cuts, len(whole)], strict=True)]
    assert keys(*pieces) == ["other"] * len(names)


@given(st.binary(max_size=200))
def test_any_bytes_are_taken(noise: bytes) -> None:
    assert all(len(key) == 1 or key in ("other", *ARROWS.values()) for key in keys(noise))
    assert not {*MOVES, *SCALES} & {"other"}
