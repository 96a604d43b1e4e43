"""Parses the XML of launch files, within limits, into elements that know their file and line."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from models.input_file import read_limited
from services.runtime.errors import BadInput, did_you_mean

MAX_BYTES = 4 << 20
"""Maximum size of a launch file [bytes]; that of a large robot has some 20 kB."""
MAX_DEPTH = 64
MAX_ELEMENTS = 50_000

_LINE_NUMBER = re.compile(r"\s*\d+\s*(<|$)")
_ARTEFACTS = {"£(": "$(", "€(": "$(", "“": '"', "”": '"', "’": "'", "</pre>": "/>", "&lt;": "<"}
"""Characters that copying from printed launch files replaces, and the right ones."""


@dataclass
class LaunchElement:
    """An element, its text, and its location."""

    tag: str
    attributes: dict[str, str]
    file: Path
    line: int
    children: list[LaunchElement] = field(default_factory=list)
    text: str = ""

    @property
    def where(self) -> str:
        """``file:line``, the prefix of errors."""
        return f"{self.file}:{self.line}"

    def fail(self, text: str) -> NoReturn:
        """Raise BadInput for this element."""
        raise BadInput(f"{self.where}: {text}")

    def check_attributes(self, known: Mapping[str, bool]) -> Iterator[str]:
        """Yield a note for each unknown attribute, which roslaunch ignores; raises BadInput for a missing one.

        Args:
            known: The allowed attributes; True for those that are required.
        """
        for name, needed in known.items():
            if needed and name not in self.attributes:
                near = did_you_mean(name, [each for each in self.attributes if each not in known])
                self.fail(f"<{self.tag}> needs the attribute {name!r}{near}")
        for name in self.attributes:
            if name not in known:
                yield f"{self.where}: <{self.tag}> has no attribute {name!r}{did_you_mean(name, known)}; it is ignored"


def read_launch_xml(path: Path) -> LaunchElement:
    """Return the root ``<launch>`` of a file; raises BadInput, with the line."""
    raw = read_limited(path, MAX_BYTES, "a launch file")
    text = raw.decode("utf-8-sig", "replace")
    return parse_launch_xml(text, path)


def parse_launch_xml(text: str, path: Path) -> LaunchElement:
    """Return the root of a text; ``path`` is named in errors. Raises BadInput."""
    lines = text.splitlines()
    before = len(text) - len(text.lstrip())
    skipped, text = text[:before].count("\n"), text[before:]
    text = re.sub(r"\A<\?xml.*?\?>", lambda found: "\n" * found[0].count("\n"), text, count=1, flags=re.DOTALL)
    root = LaunchElement("", {}, path, 1)
    stack, count = [root], 0
    parser = expat.ParserCreate()

    def line() -> int:
        return parser.CurrentLineNumber + skipped

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if len(stack) > MAX_DEPTH or count > MAX_ELEMENTS:
            raise BadInput(f"{path}:{line()}: a launch file has at most {MAX_ELEMENTS:,} elements, {MAX_DEPTH} deep")
        element = LaunchElement(tag, attributes, path, line())
        stack[-1].children.append(element)
        stack.append(element)

    def end(_: str) -> None:
        stack.pop()

    def characters(data: str) -> None:
        stack[-1].text += data

    def refuse(*_: object) -> NoReturn:
        raise BadInput(f"{path}:{line()}: the file declares a document type or entities, which a launch file must not")

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, characters
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        opened = stack[-1]
        still = f" (<{opened.tag}> of line {opened.line} is still open)" if len(stack) > 1 else ""
        number = min(line(), len(lines) or 1)
        raise BadInput(f"{path}:{number}: this is not XML: {_reason(error)}{still}{_hint(lines, number)}") from None
    top = root.children[0]
    if top.tag != "launch":
        top.fail(f"the root element is <{top.tag[:40]}>, not <launch>")
    return top


def _reason(error: expat.ExpatError) -> str:
    return expat.ErrorString(error.code)


def _hint(lines: list[str], number: int) -> str:
    """Return what copying from a web page or PDF may have done to the lines up to an error."""
    for index in range(number - 1, max(-1, number - 4), -1):
        line = lines[index] if index < len(lines) else ""
        for wrong, right in _ARTEFACTS.items():
            if wrong in line:
                return f"; line {index + 1} has {wrong!r}, which a copied text may have in place of {right!r}"
        if _LINE_NUMBER.match(line):
            return f"; line {index + 1} begins with a number: were line numbers copied with the text?"
        if "&" in line and not re.search(r"&(\w+|#\d+);", line):
            return f"; line {index + 1} has a bare '&', which XML writes as '&amp;'"
        if "--" in line.replace("<!--", "").replace("-->", "") and "<!--" in "".join(lines[: index + 1]):
            return "; a comment must not have '--' in it"
    return ""
