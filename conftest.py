"""Collects the code blocks of README.md and docs as tests (Sybil); tests/helpers/doc_blocks.py says how they run.

Those of docs are slow: `pytest -m slow docs/guide/echoes.md` runs a page.
"""

import os

if "PYTEST_XDIST_WORKER" in os.environ:  # threads of BLAS in several processes would wait for one another, at full load
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from helpers.doc_blocks import ROOT, SYBIL

pytest_collect_file = SYBIL.pytest()


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items):
    """Mark the pages of docs as slow: together they take a minute and a half. README.md is quick."""
    for item in items:
        if item.path.suffix == ".md" and item.path.parent != ROOT:
            item.add_marker(pytest.mark.slow)
