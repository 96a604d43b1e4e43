"""SDF as elements that know their file and line, within limits."""

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
"""Of an SDF file; a box takes about 500."""
MAX_DEPTH = 64
MAX_ELEMENTS = 400_000


@dataclass
class SdfElement:
    """An element, its text without the space around it, and where it stands."""

    tag: str
    attributes: dict[str, str]
    file: Path
    line: int
    children: list[SdfElement] = field(default_factory=list)
    text: str = ""

    def find(self, *tags: str) -> SdfElement | None:
        """The first child of a tag, its first child of the next, and so on."""
        here: SdfElement | None = self
        for tag in tags:
            here = next((each for each in here.children if each.tag == tag), None) if here is not None else None
        return here


ROOTS = ("sdf", "gazebo")
"""The root of an SDF, and its old name."""


def read_sdf(path: Path, roots: tuple[str, ...] = ROOTS) -> SdfElement:
    """The root of an SDF file, or of another of Gazebo's files, which is one of ``roots``; raises BadWorld."""
    try:
        text = read_limited(path, MAX_BYTES, "an SDF").decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise BadWorld(f"{path}: this is not UTF-8: {error}") from None
    except BadInput as error:
        raise BadWorld(str(error)) from None
    return parse_sdf(text, path, roots)


def parse_sdf(text: str, path: Path, roots: tuple[str, ...] = ROOTS) -> SdfElement:
    """The root of a text; ``path`` is named in errors. Raises BadWorld."""
    stack: list[SdfElement] = [SdfElement("", {}, path, 1)]
    parser, count = expat.ParserCreate(), 0
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
    """The text with every ``&`` that begins no reference as ``&amp;``.

    Gazebo's parser takes one as it stands, as descriptions of models have it, XML does not.
    """
    return re.sub(r"&(?!(?:[A-Za-z_:][\w:.-]*|#\d+|#x[0-9A-Fa-f]+);)", "&amp;", text)


def without_comments(text: str) -> str:
    """The text without its comments, but with their lines, so that those after them keep their numbers.

    Gazebo's parser takes ``--`` in a comment, XML does not. Takes time in proportion to the text, whatever it is.
    """
    parts, place = [], 0
    while (begin := text.find("<!--", place)) >= 0:
        end = text.find("-->", begin + 4)
        if end < 0:
            break
        parts += [text[place:begin], "\n" * text.count("\n", begin, end)]
        place = end + 3
    return "".join((*parts, text[place:]))
