"""No name from the network moves a cursor, sets a title or writes a clipboard."""

from __future__ import annotations

import pytest

from deploy.live.output import printable, write_text
from services.runtime.graph import Entity

ESCAPES = ("\x1b]52;c;cm0gLXJm\x07", "\x1b[2J", "\x9b2J", "\u202eevil", "\x00", "\x7f", "\u2028")


def test_a_token_with_a_control_character_is_none() -> None:
    good = Entity("1f", "pub", "/a", "/b", "pkg/Type", "SENSOR")
    assert Entity.parse(good.key) == good
    for text in ESCAPES:
        for kind, first in (("pub", 3), ("node", 4)):
            chunks = good.key.replace("pub", kind).split("/")
            for at in range(first, len(chunks)):
                assert Entity.parse("/".join([*chunks[:at], chunks[at] + text, *chunks[at + 1 :]])) is None


def test_what_is_printed_shows_control_characters(capsys: pytest.CaptureFixture[str]) -> None:
    for text in ESCAPES:
        write_text(f"name {text}\ta\u00e4\u4e2d\n")
        out = capsys.readouterr().out
        assert out == printable(out) == f"name {printable(text)}\ta\u00e4\u4e2d\n"
        assert all(each.isprintable() for each in out.strip("\n").replace("\t", ""))
        assert "\\u" in out
