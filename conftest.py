"""Collects the code blocks of README.md and docs as tests (Sybil); tests/helpers/doc_blocks.py says how they run."""

from helpers.doc_blocks import SYBIL

pytest_collect_file = SYBIL.pytest()
