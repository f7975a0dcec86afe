"""Collects the code blocks of README.md and docs as tests (Sybil); tests/helpers/doc_blocks.py says how they run."""

import os

if "PYTEST_XDIST_WORKER" in os.environ:  # threads of BLAS in several processes would wait for one another, at full load
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from helpers.doc_blocks import SYBIL

pytest_collect_file = SYBIL.pytest()
