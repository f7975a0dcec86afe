"""The site: pages of docs, README and CHANGELOG, and the reference, by Sphinx: python docs/site/build.py

Pages are copied to out/site/source, in the folders that they have here, so that their links hold. The menu follows from
the lists of docs/README.md and is appended to the copy of README.md. The site is out/site/html/index.html. Warnings are
errors.
"""

from __future__ import annotations

import base64
import json
import re
import shutil
import sys
from pathlib import Path

from reference import menu, pages, public_name

ROOT = Path(__file__).parents[2]
SITE = ROOT / "out" / "site"
CONTENTS = Path("docs/README.md")
BESIDE = ("README.md", "CHANGELOG.md", "CITATION.cff")  # docs
FILES = (".png", ".svg", ".cff")  # that pages show or offer
_ITEM = re.compile(r"^(?:\d+\.|-) \[([^\]]+)\]\(([^)#]+)\.(?:md|ipynb)\)", re.M)
_CODE = re.compile(r"^(```.*?^```|#[^\n]*|    [^\n]*)$|(?<![\[`])`(sarcl\.[\w.]+)`(?!\])", re.M | re.S)
_OUTSIDE = re.compile(r"\]\(((?:\.\./)+(?!README|CHANGELOG|docs/)[^)#]+\.md)")


def stage(source: Path) -> None:
    """Write what Sphinx reads: copies of the pages with their pictures, and the reference."""
    shutil.rmtree(source, ignore_errors=True)
    for path in [*(ROOT / name for name in BESIDE), *(ROOT / "docs").rglob("*.*")]:
        if path.suffix in (".md", *FILES):
            _copy(path, source / path.relative_to(ROOT))
            for link in _OUTSIDE.findall(path.read_text()) if path.suffix == ".md" else ():
                page = (path.parent / link).resolve()
                _copy(page, source / page.relative_to(ROOT), "---\norphan: true\n---\n\n")
    for path in (ROOT / "docs" / "notebooks").glob("*.ipynb"):
        _notebook(path, (source / path.relative_to(ROOT)).with_suffix(".md"))
    (source / "README.md").rename(source / "index.md")
    for path in source.rglob("*.md"):
        up = "../" * (len(path.relative_to(source).parts) - 1)
        text = path.read_text().replace(f"]({up}README.md", f"]({up}index.md").replace(".ipynb)", ".md)")
        path.write_text(_CODE.sub(_to_reference, text))
    (source / "reference").mkdir()
    for name, text in pages().items():
        (source / "reference" / name).write_text(text)
    _append_menus(source)


def _to_reference(match: re.Match[str]) -> str:
    """A name of the package between backticks, outside code and headings, as a link to its page."""
    path = public_name(match[2]) if match[2] else None
    return f"{{py:obj}}`{match[2]} <sarcl.{path}>`" if path else match[0]


def _copy(path: Path, target: Path, head: str = "") -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    if head:
        target.write_text(head + path.read_text())
    else:
        shutil.copy(path, target)


def _notebook(path: Path, target: Path) -> None:
    """A notebook as a page: its text, its code, and what it printed and drew when it was stored."""
    target.parent.mkdir(parents=True, exist_ok=True)
    parts = []
    for i, cell in enumerate(json.loads(path.read_text())["cells"]):
        text = "".join(cell["source"])
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
        for k, output in enumerate(cell.get("outputs", ())):
            data = output.get("data", {})
            if "image/png" in data:
                picture = target.with_name(f"{target.stem}_{i}_{k}.png")
                picture.write_bytes(base64.b64decode("".join(data["image/png"])))
                parts.append(f"![What the cell above draws]({picture.name})")
            elif "text" in output or "text/plain" in data:
                parts.append(f"```text\n{''.join(output.get('text', data.get('text/plain', '')))}\n```")
    target.write_text("\n\n".join(parts) + "\n")


def _append_menus(source: Path) -> None:
    """The menu: sections of docs/README.md with the pages that they list, the reference, and the changes."""
    contents = (source / CONTENTS).read_text()
    menus = []
    for section in re.split(r"^## ", contents, flags=re.M)[1:]:
        title, _, text = section.partition("\n")
        listed = [f"{name} <docs/{page}>" for name, page in _ITEM.findall(text)]
        if listed:
            menus.append(_menu(title.partition(":")[0], listed))
    menus.insert(0, _menu("sarcl", ["All pages <docs/README>", "Changes <CHANGELOG>"]))
    menus.insert(2, _menu("Reference", menu()))  # behind the guide
    with (source / "index.md").open("a") as page:
        page.write("\n" + "\n".join(menus))


def _menu(caption: str, entries: list[str]) -> str:
    return f"```{{toctree}}\n:hidden:\n:caption: {caption}\n\n" + "\n".join(entries) + "\n```\n"


def main() -> int:
    """Build the site; the exit status of Sphinx."""
    from sphinx.cmd.build import main as sphinx

    stage(SITE / "source")
    arguments = ["-q", "-W", "--keep-going", "-E", "-b", "html", "-c", str(Path(__file__).parent)]
    status = sphinx([*arguments, "-d", str(SITE / "doctrees"), str(SITE / "source"), str(SITE / "html")])
    if status == 0:
        print((SITE / "html" / "index.html").relative_to(ROOT))
    return status


if __name__ == "__main__":
    sys.exit(main())
