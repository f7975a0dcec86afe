"""The packages of the wheel, its description, and what an sdist holds besides: tests and all that they read."""

import re
import tomllib
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.sdist import sdist

FILES = ("CHANGELOG.md", "CITATION.cff", "Makefile", "conftest.py", ".gitignore")
FOLDERS = (".ci", ".github", "bench", "docs", "kernels", "tests")


LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?![a-z]+:|#)([^)\s]+)\)")  # to a file of the repository


def description(text: str, source: str | None) -> str:
    """README.md for a package index, where its links to files of the repository lead nowhere.

    source  the repository's page, `Source` of [project.urls], that links lead to instead; None: they become their text,
            and images are left out
    """

    def absolute(link: re.Match[str]) -> str:
        image, words, path = link.groups()
        if source is None:
            return "" if image else words
        return f"{image}[{words}]({source.rstrip('/')}/{'raw' if image else 'blob'}/HEAD/{path})"

    return LINK.sub(absolute, text).lstrip()


class SourcesAndTests(sdist):
    """An sdist from which the tests run: `make test` in it, as in a checkout."""

    def make_distribution(self):
        """Write the archive, with FILES, and FOLDERS but for caches in them."""
        paths = [path for folder in FOLDERS for path in sorted(Path(folder).rglob("*")) if path.is_file()]
        self.filelist.extend([*FILES, *(path.as_posix() for path in paths if "__pycache__" not in path.parts)])
        self.filelist.remove_duplicates()
        super().make_distribution()


urls = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"].get("urls", {})
setup(
    packages=[*find_packages(include=["sarcl", "sarcl.*"]), "sarcl.kernels"],  # every folder of sarcl/, and kernels/
    long_description=description(Path("README.md").read_text(encoding="utf-8"), urls.get("Source")),
    long_description_content_type="text/markdown",
    cmdclass={"sdist": SourcesAndTests},
)
