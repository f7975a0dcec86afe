"""The page of Wan et al. 2004: published beside measured values."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sarcl import papers
from sarcl.cli import parser
from sarcl.opencl.choose_device import open_device
from sarcl.papers.lab import Lab
from sarcl.papers.wan import _errata, _patches

DIFFERENT = {"coefficient as permittivity grows", "phase of an echo from 0.02 m farther, L band"}


def test_patches_rise_in_the_order_of_figure_4():
    values = _patches.values(0.16, 0.01)
    assert values[13] == 0.16  # the 14th has the middle value
    assert np.diff(values[np.subtract(_patches.ORDER, 1)]) == pytest.approx(0.01)
    assert (values.min(), values.max()) == pytest.approx((0.08, 0.23))


def test_errors_in_print_are_measured():
    area, phase = _errata.section(Lab(open_device(None), quick=True)).rows
    assert area.holds and area.value == pytest.approx(1 / np.cos(np.radians(20)), abs=1e-5)
    assert not phase.holds and phase.value == pytest.approx(-4 * np.pi * 0.02 * 1.27e9 / 299792458.0, abs=0.02)


@pytest.mark.slow
def test_the_command_writes_a_page_with_the_known_differences(tmp_path):
    assert parser.main(["papers", "wan", "--quick", "-o", str(tmp_path)]) == 0
    document = json.loads((tmp_path / "wan.json").read_text())
    rows = {row["item"]: row for section in document["sections"] for row in section["rows"]}
    assert document["finished"] and {item for item, row in rows.items() if not row["holds"]} == DIFFERENT
    slope = next(s["numbers"]["slope"] for s in document["sections"] if s["key"] == "patches")
    assert slope == pytest.approx(1, abs=0.1)  # of the brightness over |R(0)|^2, dB per dB
    assert set(papers.find("wan").main) <= set(rows)
    text = (tmp_path / "wan.html").read_text()
    assert text.index("Conclusion") < text.index("<figure") and "sarcl papers wan --quick" in text
