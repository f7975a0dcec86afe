"""XML files of others: parsed without document types, whose entities may read other files."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from .. import input_paths


class Refused(Exception):
    """The message says what the file is or has, after its name."""


class _Builder(ElementTree.TreeBuilder):
    """A tree of elements, refused while it is built."""

    instructions = True

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
    Refused for a file that is no XML, or has a document type. Errors of input_paths.
    """
    text = input_paths.contents(path, what)
    builder = _Builder()
    builder.instructions = instructions
    try:
        return ElementTree.fromstring(text, ElementTree.XMLParser(target=builder))
    except (ElementTree.ParseError, ValueError, LookupError) as exc:  # ValueError, LookupError: of the encoding
        raise Refused(f"cannot be read as XML ({exc})") from None
