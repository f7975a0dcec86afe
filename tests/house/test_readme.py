"""The README's example runs word for word, and what it names exists."""

from __future__ import annotations

import re
from pathlib import Path

import sarcl

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


def test_the_example_runs_and_writes_its_picture(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    example = re.search(r"```python\n(import numpy.*?)```", README, re.S)[1]
    names: dict = {}
    exec(compile(example, "README.md", "exec"), names)
    assert (tmp_path / "hill.png").stat().st_size > 10_000
    assert names["image"].report.predicted_error <= 1e-3


def test_links_point_at_files():
    links = re.findall(r"\]\(([^)#]+)\)", README)
    assert len(links) > 4
    for link in links:
        assert (ROOT / link).is_file(), link


def test_every_public_name_has_a_docstring():
    for name in sarcl.__all__:
        assert getattr(sarcl, name).__doc__, name
