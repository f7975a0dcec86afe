"""The packages of the wheel, and what an sdist holds besides: tests and all that they read."""

from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.sdist import sdist

FILES = ("CHANGELOG.md", "CITATION.cff", "Makefile", "conftest.py", ".gitignore")
FOLDERS = (".ci", ".github", "bench", "docs", "kernels", "tests")


class SourcesAndTests(sdist):
    """An sdist from which the tests run: `make test` in it, as in a checkout."""

    def make_distribution(self):
        """Write the archive, with FILES, and FOLDERS but for caches in them."""
        paths = [path for folder in FOLDERS for path in sorted(Path(folder).rglob("*")) if path.is_file()]
        self.filelist.extend([*FILES, *(path.as_posix() for path in paths if "__pycache__" not in path.parts)])
        self.filelist.remove_duplicates()
        super().make_distribution()


# every folder of sarcl/, and kernels/ as sarcl.kernels
setup(packages=[*find_packages(include=["sarcl", "sarcl.*"]), "sarcl.kernels"], cmdclass={"sdist": SourcesAndTests})
