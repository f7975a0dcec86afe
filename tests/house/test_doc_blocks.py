"""Every code block of README.md and docs is run by Sybil (tests/helpers/doc_blocks.py); a mistake in one fails."""

from __future__ import annotations

import re
from collections import Counter

import pytest
from helpers.doc_blocks import INSTALLS, LANGUAGES, PAGES, ROOT, SYBIL, installs
from sybil.example import NotEvaluated

FENCE = re.compile(r"^```([^\n]*)\n(.*?)^```$", re.S | re.M)
COMMAND = re.compile(r"^(?:\$ |>>> |sarcl |make |pip |sudo |\.venv/|python |import |from \w+ import )")


def fences(text: str) -> list[tuple[str, str]]:
    """Language and content of every fenced block of a page."""
    return [(match[1], match[2]) for match in FENCE.finditer(text)]


def indented(text: str) -> list[str]:
    """Lines of the blocks that are indented by four spaces: equations and listings."""
    blocks = re.findall(r"(?<=\n\n)(?: {4}[^\n]*\n)+", FENCE.sub("", text))
    return [line[4:] for block in blocks for line in block.splitlines()]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_block_of_a_page_is_run_or_installs_something(page):
    blocks = fences(page.read_text())
    assert page.read_text().count("```") == 2 * len(blocks)
    assert {language for language, _ in blocks} <= set(LANGUAGES)
    assert not [line for line in indented(page.read_text()) if COMMAND.match(line)], "fence it, and say its language"
    skipped = [source for language, source in blocks if language == "sh" and installs(source)]
    assert not any(re.search(r"^sarcl ", source, re.M) for source in skipped), f"sarcl in a block of {INSTALLS}"
    skips = re.findall(r"<!--+ skip: (?!end)(.*)", page.read_text())
    assert all(" if(" in skip and "reason=" in skip for skip in skips), "a block is skipped for a stated lack alone"
    parsed = [example.parsed for example in SYBIL.parse(page).examples()]
    run = Counter(str(source) for source in parsed if isinstance(source, str))  # others: skip comments, >>> lines
    expected = Counter(source for language, source in blocks if source not in skipped and source[:3] != ">>>")
    assert run == expected


def outcome(tmp_path, monkeypatch, text: str) -> str:
    """Run a page; returns "passed", or the report of its first failing block."""
    page = tmp_path / "page.md"
    page.write_text(text)
    monkeypatch.setattr("helpers.doc_blocks.SYBIL.path", tmp_path)
    document = SYBIL.parse(page)
    SYBIL.setup(document.namespace)
    try:
        for example in document.examples():
            try:
                example.evaluate()
            except NotEvaluated:
                pass
            except Exception as exc:
                return f"{type(exc).__name__}: {exc}"
    finally:
        SYBIL.teardown(document.namespace)
    return "passed"


RIGHT = """
```python
import math
x = math.pi
```

```python
>>> print(x)
3.14
>>> [].pop()
Traceback (most recent call last):
    ...
IndexError: pop from empty list
```

```toml
# case.toml
[fda]
n = 9
```

```sh
test -f case.toml && python -c "import sarcl"
```
"""


def test_a_right_page_passes_and_leaves_no_file(tmp_path, monkeypatch):
    assert outcome(tmp_path, monkeypatch, RIGHT) == "passed"
    assert [path.name for path in tmp_path.iterdir()] == ["page.md"]


@pytest.mark.parametrize(
    ("right", "wrong", "report"),
    [
        ("math.pi", "math.py", "AttributeError"),
        ("import math", "", "NameError"),
        ("3.14\n", "3.16\n", "Expected:\n    3.16"),
        ("from empty", "from full", "from full"),
        ("n = 9", "m = 9", "'m'"),
        ("# case.toml\n", "", "does not name a file"),
        ("# case.toml", "# case.toml, continued", "does not exist yet"),
        ("-f case.toml", "-f other.toml", "exit status 1"),
        ("import sarcl", "import sarcl.nothing", "No module named"),
    ],
)
def test_a_deliberate_mistake_fails(tmp_path, monkeypatch, right, wrong, report):
    assert right in RIGHT
    assert report in outcome(tmp_path, monkeypatch, RIGHT.replace(right, wrong))
