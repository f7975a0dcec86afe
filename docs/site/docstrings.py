"""Docstrings of the package as Markdown: lists of parameters, equations, examples, and links to pages and names."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Mapping

# "name  meaning", "a, b   meaning"; a word alone is a name only with two spaces after it
_ENTRY = re.compile(r"(?P<names>[*\w.]+(?:\[\w*\])?(?:, [*\w.]+)*(?:\([\w, ]*\))?) {2,}(?P<text>\S.*)")
_SECOND = re.compile(r"; {2,}(?=\w+(?:, \w+)* {2,}\S)")  # two entries on one line
_PROMPT = re.compile(r"^ *>>> ")
_LEADS = ("Returns", "Raises", "Source:")
_CODE = re.compile(r"(``.+?``|`[^`\n]+`)", re.S)
_PAGE = re.compile(r"\bdocs/([\w/]+)\.md\b")

Link = Callable[[str], str | None]  # text between backticks -> the public name that it is, behind "sarcl."


def markdown(doc: str, types: Mapping[str, str], link: Link, up: str = "../") -> str:
    """A docstring as Markdown.

    types  name -> type and default, shown where the docstring lists the name
    link   link(code): the public name that text between backticks is, or None;  up  from the page to the root
    """
    return "\n\n".join(_block(block, types, link, up) for block in _blocks(doc)) + "\n"


def entries(doc: str) -> dict[str, str]:
    """Parameters that a docstring lists: name -> meaning."""
    return {name: text for block in _blocks(doc) for names, text in _list(block) or () for name in names.split(", ")}


def examples(doc: str) -> list[str]:
    """Blocks of a docstring that begin with >>>."""
    return [textwrap.dedent(block) for block in _blocks(doc) if _PROMPT.match(block)]


def _blocks(doc: str) -> list[str]:
    """Paragraphs; text behind an indented paragraph or a list, without an empty line, is one of its own."""
    apart = re.sub(r"((?:^|\n\n)(?:    [^\n]*\n)+)(?=\S)", r"\1\n", doc.strip("\n"))
    blocks = [block.rstrip() for block in re.split(r"\n\s*\n", apart) if block.strip()]
    return [part for block in blocks for part in _parts(block)]


def _parts(block: str) -> list[str]:
    """A list of parameters and the text behind it; other blocks as they are."""
    lines = block.splitlines()
    if not _ENTRY.fullmatch(lines[0]):
        return [block]
    end = next((i for i, line in enumerate(lines) if not (line.startswith(" ") or _ENTRY.fullmatch(line))), len(lines))
    return ["\n".join(lines[:end]), *(["\n".join(lines[end:])] if end < len(lines) else [])]


def _list(block: str) -> list[tuple[str, str]] | None:
    """(names, meaning) of each entry of a list of parameters; None for other blocks."""
    lines = textwrap.dedent(block).splitlines()
    found: list[tuple[str, str]] = []
    for line in lines:
        if not line.startswith(" "):
            match = _ENTRY.fullmatch(line)
            if match is None:
                return None
            found.append((match["names"], match["text"]))
        elif found:
            found[-1] = found[-1][0], f"{found[-1][1]} {line.strip()}"
        else:
            return None
    pairs = []
    for names, text in found:
        first, *others = _SECOND.split(text)
        pairs += [(names, first), *(tuple(re.split(r" {2,}", other, maxsplit=1)) for other in others)]
    return pairs


def _block(block: str, types: Mapping[str, str], link: Link, up: str) -> str:
    if _PROMPT.match(block):
        return f"```python\n{textwrap.dedent(block)}\n```"
    listed = _list(block)
    if listed:
        return "\n\n".join(f"{_term(names, types)}\n: {_prose(text, link, up)}" for names, text in listed)
    if all(line.startswith("    ") for line in block.splitlines()):
        return f"```text\n{textwrap.dedent(block)}\n```"
    if re.search(r" {3,}\S", block):  # columns: an equation beside its condition
        return f"```text\n{block}\n```"
    text = _prose(re.sub(r"::$", ":", block), link, up)
    lead = next((lead for lead in _LEADS if text.startswith(lead)), None)
    return f"**{lead}**{text[len(lead) :]}" if lead else text


def _term(names: str, types: Mapping[str, str]) -> str:
    kinds = {types[name] for name in names.split(", ") if name in types}
    kind = f" {kinds.pop()}" if len(kinds) == 1 else ""
    return ", ".join(f"`{name}`" for name in names.split(", ")) + kind


def _prose(text: str, link: Link, up: str) -> str:
    """Text with Markdown's marks escaped outside backticks, and links."""
    parts = _CODE.split(" ".join(text.split()))
    return "".join(_code(part, link) if i % 2 else _escaped(part, up) for i, part in enumerate(parts))


def _code(code: str, link: Link) -> str:
    path = link(code.strip("`"))
    return f"{{py:obj}}`{code.strip('`')} <sarcl.{path}>`" if path else code


def _escaped(text: str, up: str) -> str:
    text = re.sub(r"([\\*<\[\]#~$])", r"\\\1", text)
    text = re.sub(r"(?<!\w)_|_(?!\w)", r"\\_", text)
    text = re.sub(r"^([-+]|\d+\.)(?= )", r"\\\1", text)
    return _PAGE.sub(lambda page: f"[{page[1].rpartition('/')[2].replace('_', ' ')}]({up}docs/{page[1]}.md)", text)
