"""The page of Wan et al. 2004: published beside measured values."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sarcl import papers
from sarcl.cli import parser
from sarcl.opencl.choose_device import open_device
from sarcl.papers import lab
from sarcl.papers.lab import SIGNIFICANT, Lab
from sarcl.papers.paper import Section

DIFFERENT = {"coefficient as permittivity grows", "phase of an echo from 0.02 m farther, L band"}


def test_errors_in_print_are_measured():
    *_, errors_in_print = papers.find("wan").sections
    area, phase = errors_in_print(Lab(open_device(None), quick=True)).rows
    assert area.holds and area.value == pytest.approx(1 / np.cos(np.radians(20)), abs=1e-5)
    assert not phase.holds and phase.value == pytest.approx(-4 * np.pi * 0.02 * 1.27e9 / 299792458.0, abs=0.02)


def test_the_test_of_phases_is_said_as_a_verdict():
    out = Section.of("wan", "speckle")
    for p in (0.999, 1e-4):
        out.states("phases", p, p > SIGNIFICANT, verdict=lab.tested(p))
    assert [row.measured for row in out.rows] == ["not rejected: p = 1", "rejected: p = 1.0e-04"]


@pytest.mark.slow
def test_the_command_writes_a_page_with_the_known_differences(tmp_path):
    assert parser.main(["papers", "wan", "--quick", "-o", str(tmp_path)]) == 0
    document = json.loads((tmp_path / "wan.json").read_text())
    rows = {row["item"]: row for section in document["sections"] for row in section["rows"]}
    assert document["finished"] and {item for item, row in rows.items() if not row["holds"]} == DIFFERENT
    numbers = next(s["numbers"] for s in document["sections"] if s["key"] == "patches")
    # figure 4: values rise from patch 1 to patch 10, numbered row by row
    assert [np.argmin(numbers["roughness"]), np.argmax(numbers["roughness"])] == [0, 9]
    assert numbers["slope"] == pytest.approx(1, abs=0.1)  # of the brightness over |R(0)|^2, dB per dB
    assert set(papers.find("wan").main) <= set(rows)
    text = (tmp_path / "wan.html").read_text()
    assert text.index("Conclusion") < text.index("<figure") and "sarcl papers wan --quick" in text
