"""SDF as elements with file and line, within limits."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from messages.errors import BadInput
from models.bodies import BadWorld
from models.input_file import read_limited

MAX_BYTES = 8 << 20
"""Maximum size of an SDF file [bytes]; a box takes about 500."""
MAX_DEPTH = 64
MAX_ELEMENTS = 400_000


@dataclass
class SdfElement:
    """An element, its text without surrounding space, and its place in the file."""

    tag: str
    attributes: dict[str, str]
    file: Path
    line: int
    children: list[SdfElement] = field(default_factory=list)
    text: str = ""

    def find(self, *tags: str) -> SdfElement | None:
        """Return the first child with the first tag, its first child with the next one, and so on."""
        here: SdfElement | None = self
        for tag in tags:
            here = next((each for each in here.children if each.tag == tag), None) if here is not None else None
        return here


ROOTS = ("sdf", "gazebo")
"""The root tag of SDF, and its old name."""


def read_sdf(path: Path, roots: tuple[str, ...] = ROOTS) -> SdfElement:
    """Read the root of an SDF file, or of another Gazebo file with a root tag in ``roots``; raises BadWorld."""
    try:
        text = read_limited(path, MAX_BYTES, "an SDF").decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise BadWorld(f"{path}: this is not UTF-8: {error}") from None
    except BadInput as error:
        raise BadWorld(str(error)) from None
    return parse_sdf(text, path, roots)


def parse_sdf(text: str, path: Path, roots: tuple[str, ...] = ROOTS) -> SdfElement:
    """Parse a text to its root; ``path`` is used in errors. Raises BadWorld."""
    stack: list[SdfElement] = [SdfElement("", {}, path, 1)]
    parser, count = expat.ParserCreate("utf-8"), 0
    # White space before the declaration is not XML.
    before = len(text) - len(text.lstrip())
    skipped, text = text[:before].count("\n"), text[before:]

    def line() -> int:
        return parser.CurrentLineNumber + skipped

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if len(stack) > MAX_DEPTH or count > MAX_ELEMENTS:
            raise BadWorld(f"{path}:{line()}: an SDF has at most {MAX_ELEMENTS:,} elements, {MAX_DEPTH} deep")
        element = SdfElement(tag, attributes, path, line())
        stack[-1].children.append(element)
        stack.append(element)

    def end(_: str) -> None:
        element = stack.pop()
        element.text = element.text.strip()

    def characters(data: str) -> None:
        stack[-1].text += data

    def refuse(*_: object) -> NoReturn:
        raise BadWorld(f"{path}:{line()}: the SDF declares a document type or entities: it needs none")

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, characters
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(with_escaped_ampersands(without_comments(text)).encode(), True)
    except (expat.ExpatError, UnicodeEncodeError) as error:
        raise BadWorld(f"{path}:{line()}: the SDF is not XML: {error}") from None
    root = stack[0].children[0]
    if root.tag not in roots:
        raise BadWorld(f"{path}:{root.line}: the root is <{root.tag[:40]}>, not <{roots[0]}>")
    return root


def with_escaped_ampersands(text: str) -> str:
    """Escape every ``&`` that does not begin a reference as ``&amp;``.

    Gazebo's parser accepts a bare one, which occurs in model descriptions; XML does not.
    """
    return re.sub(r"&(?!(?:[A-Za-z_:][\w:.-]*|#\d+|#x[0-9A-Fa-f]+);)", "&amp;", text)


def without_comments(text: str) -> str:
    """Remove the comments of a text but keep their line breaks, and with them the line numbers.

    Gazebo's parser accepts ``--`` in a comment, XML does not. Takes time linear in the length of any text.
    """
    parts, place = [], 0
    while (begin := text.find("<!--", place)) >= 0:
        end = text.find("-->", begin + 4)
        if end < 0:
            break
        parts += [text[place:begin], "\n" * text.count("\n", begin, end)]
        place = end + 3
    return "".join((*parts, text[place:]))
