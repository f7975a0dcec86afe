"""Links: every relative link, picture and #anchor of the documentation resolves, and so do pages cited in the code."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / ".github").glob("*.md")), *sorted(DOCS.rglob("*.md"))]
CODE = ["sarcl", "kernels", "tests", "bench", ".ci", "docs"]
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(\s*([^)\s]+)\s*\)|<(?:img|a)\b[^>]*?\b(?:src|href)=\"([^\"]+)\"")


def prose(text: str) -> str:
    """A page without its code, fenced, indented or between backticks: what looks like a link there is none."""
    text = re.sub(r"^(```|~~~).*?^\1[^\n]*$", "", text, flags=re.S | re.M)
    text = re.sub(r"(?<=\n\n)(?: {4,}[^\n]*\n)+", "\n", text)
    return re.sub(r"`[^`\n]*`", "", text)


def anchors(text: str) -> set[str]:
    """Names that GitHub gives the headings of a page: lower case, hyphens for spaces, -1 for a repeat."""
    text = re.sub(r"^(```|~~~).*?^\1[^\n]*$", "", text, flags=re.S | re.M)
    found: dict[str, int] = {}
    names = set(re.findall(r"<a (?:id|name)=\"([^\"]+)\"", text))
    for heading in re.findall(r"^#{1,6}\s+(.*?)\s*#*$", text, flags=re.M):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        name = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        names.add(f"{name}-{found[name]}" if name in found else name)
        found[name] = found.get(name, 0) + 1
    return names


def broken(page: Path, root: Path) -> list[str]:
    """Links of `page` that lead nowhere, each with the reason; addresses with a scheme are left alone."""
    wrong = []
    for match in LINK.finditer(prose(page.read_text())):
        link = match[1] or match[2]
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        if not target.is_relative_to(root) or not target.exists():
            wrong.append(f"{link}: there is no {target}")
        elif anchor and (target.suffix != ".md" or anchor not in anchors(target.read_text())):
            wrong.append(f"{link}: {target.name} has no heading of this name")
    return wrong


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_no_page_has_more_than_300_lines(page):
    assert len(page.read_text().splitlines()) <= 300, "make two pages of it, or a file of its tables"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_relative_link_and_anchor_resolves(page):
    assert broken(page, ROOT) == []


def test_links_that_lead_nowhere_are_found(tmp_path):
    (tmp_path / "a.md").write_text("# A title, `code` & more\n\n## Twice\n\n## Twice\n\n```\n# no heading\n```\n")
    page = tmp_path / "b.md"
    page.write_text(
        '[1](a.md) [2](a.md#a-title-code--more) [3](a.md#twice-1) [4](#here) <img src="a.md"> [5](https://x.org/y)\n'
        "`[no link](none.md)`\n\n    [nor this](none.md)\n\n## Here\n\n"
        "[6](none.md) ![7](none.png) [8](a.md#no-heading) [9](a.md#twice-2) [10](#there) [11](../../etc) "
        '<img src="no.svg">\n'
    )
    assert [line.split(":")[0] for line in broken(page, tmp_path)] == [
        "none.md", "none.png", "a.md#no-heading", "a.md#twice-2", "#there", "../../etc", "no.svg",
    ]  # fmt: skip


def test_every_page_and_picture_is_reached_from_the_contents_page():
    reached, waiting = set(), [DOCS / "README.md", ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        for match in LINK.finditer(prose(page.read_text())):
            target = (page.parent / (match[1] or match[2]).partition("#")[0]).resolve()
            if target.is_file() and target not in reached:
                reached.add(target)
                waiting += [target] if target.suffix == ".md" else []
    contents = {
        (DOCS / link).resolve() for link in re.findall(r"\]\(([^)#]+)\)", (DOCS / "README.md").read_text())
    }  # every page stands there itself, pictures on the pages that show them
    pages = set(DOCS.rglob("*.md")) - {DOCS / "README.md"}
    assert pages - contents == set()
    assert {p for p in DOCS.rglob("*") if p.suffix in (".png", ".svg")} - reached == set()


def test_pages_cited_in_the_code_exist():
    files = [path for folder in CODE for path in (ROOT / folder).rglob("*") if path.is_file()]
    cited: dict[str, Path] = {}
    for path in [*(path for path in files if path.suffix not in (".png", ".pyc")), *PAGES, ROOT / "Makefile"]:
        if path != Path(__file__):
            for page in re.findall(r"\bdocs/[\w/-]+\.(?:md|png|svg)\b", path.read_text(errors="ignore")):
                cited.setdefault(page, path)
    assert len(cited) > 10
    assert {page: str(path) for page, path in cited.items() if not (ROOT / page).is_file()} == {}
