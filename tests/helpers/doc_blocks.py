"""How Sybil runs the code blocks of README.md and docs: those of a page in order, in one namespace, in a fresh folder.

    python   is executed. A block that begins with >>> is compared with the output or error that it shows, numbers
             to one unit of the last digit shown.
    toml     names its file in its first line: "# scene.toml", or "# scene.toml, continued" for lines to be appended.
             The file is written, and must load as a scenario or, with a table [fda], as an experiment.
    sh       is executed by bash, with the programs of this Python first on the path. A block whose first word is in
             INSTALLS sets up a machine, and is not run.

Nothing is prepared for a page: what its blocks need, earlier blocks of the page make. A block that needs more (measured
data, an optional package) says so in the text before it, and in a comment that Sybil reads (`skip: next if(...)`).
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterable
from doctest import ELLIPSIS, NORMALIZE_WHITESPACE
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sybil import Document, Example, Region, Sybil
from sybil.evaluators.doctest import NUMBER
from sybil.parsers.markdown import CodeBlockParser, PythonCodeBlockParser, SkipParser

from sarcl import scenario
from sarcl.experiments.fda import file as experiment

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
LANGUAGES = ("python", "toml", "sh")
INSTALLS = ("make", "pip", "sudo", "python3")
_NAMED = re.compile(r"# ([\w-]+\.toml)(, continued)?\n")


def _load_toml(example: Example) -> str | None:
    """Write the block to the file that its first line names, and load that file."""
    named = _NAMED.match(example.parsed)
    if named is None:
        return "the first line does not name a file, such as # scene.toml"
    path = Path(named[1])
    if bool(named[2]) != path.exists():
        return f"{path} exists: write '# {path}, continued'" if path.exists() else f"{path} does not exist yet"
    with path.open("a") as file:
        file.write(example.parsed)
    tables = path.read_text()
    (experiment.load if re.search(r"^\[fda\]", tables, re.M) else scenario.load)(path)
    return None


def _run_sh(example: Example) -> str | None:
    """Run the block in bash; a command that fails ends it, and what it printed is the message."""
    programs = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", example.parsed],
        env=os.environ | {"PATH": programs}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    return f"exit status {done.returncode}\n{done.stdout}" if done.returncode else None


def installs(source: str) -> bool:
    """Whether a shell block sets up a machine; such blocks are not run."""
    return source.split()[0] in INSTALLS


def _shell_blocks(document: Document) -> Iterable[Region]:
    return (region for region in CodeBlockParser("sh", _run_sh)(document) if not installs(region.parsed))


class _Folders:
    """A fresh current folder for each page."""

    def __init__(self) -> None:
        self.open: dict[int, tuple[str, TemporaryDirectory]] = {}

    def enter(self, namespace: dict[str, Any]) -> None:
        folder = TemporaryDirectory(prefix="sarcl-page-", ignore_cleanup_errors=True)
        self.open[id(namespace)] = os.getcwd(), folder
        os.chdir(folder.name)

    def leave(self, namespace: dict[str, Any]) -> None:
        before, folder = self.open.pop(id(namespace))
        os.chdir(before)
        namespace.clear()  # files that the page left open are closed before their folder goes
        folder.cleanup()


_FOLDERS = _Folders()
SYBIL = Sybil(
    parsers=[
        SkipParser(),
        PythonCodeBlockParser(doctest_optionflags=ELLIPSIS | NUMBER | NORMALIZE_WHITESPACE),
        CodeBlockParser("toml", _load_toml),
        _shell_blocks,
    ],
    path=str(ROOT),
    patterns=["README.md", "docs/*.md", "docs/*/*.md"],
    setup=_FOLDERS.enter,
    teardown=_FOLDERS.leave,
)
