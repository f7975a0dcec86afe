"""XML files of others: parsed where their size, depth and number of elements bound the memory and the time."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from .. import input_paths

MOST_BYTES = 64_000_000  # size of a file; orbits of a day have 5 MB, virtual rasters of 30 000 sources 20 MB
MOST_ELEMENTS = 500_000  # about 200 bytes each in memory; orbits of a day have 100 000
DEEPEST = 64  # elements within one another; orbits have 6


class Refused(Exception):
    """The message says what the file is or has, after its name."""


class _Builder(ElementTree.TreeBuilder):
    """A tree of elements, refused while it is built."""

    count = depth = 0
    instructions = True

    def start(self, tag: str, attrs: dict[str, str]) -> ElementTree.Element:
        self.count += 1
        self.depth += 1
        if self.count > MOST_ELEMENTS:
            raise Refused(f"has more than {MOST_ELEMENTS:,} elements")
        if self.depth > DEEPEST:
            raise Refused(f"has elements within one another, more than {DEEPEST} deep")
        return super().start(tag, attrs)

    def end(self, tag: str) -> ElementTree.Element:
        self.depth -= 1
        return super().end(tag)

    def doctype(self, name: str, public: str | None, system: str | None) -> None:
        """Entities of a document type may expand to far more text than the file has, or read other files."""
        raise Refused("has a document type (<!DOCTYPE>), which may define entities")

    def pi(self, target: str, data: str | None = None) -> None:  # type: ignore[override]  # instructions are no elements
        """A processing instruction, <?target data?>."""
        if not self.instructions:
            raise Refused(f"has a processing instruction (<?{target:.40}), which programs take differently")


def parsed(path: Path, what: str, instructions: bool = True) -> ElementTree.Element:
    """The root element of a file, which messages of `input_paths` call `what`.

    instructions  False refuses processing instructions
    Refused for a file that is too large, no XML, or asks for far more memory than its size. Errors of input_paths.
    """
    text = input_paths.contents(path, what, MOST_BYTES)
    if len(text) > MOST_BYTES:
        raise Refused(f"has more than {MOST_BYTES / 1e6:.0f} MB")
    builder = _Builder()
    builder.instructions = instructions
    try:
        return ElementTree.fromstring(text, ElementTree.XMLParser(target=builder))
    except (ElementTree.ParseError, ValueError, LookupError) as exc:  # ValueError, LookupError: of the encoding
        raise Refused(f"cannot be read as XML ({exc})") from None
