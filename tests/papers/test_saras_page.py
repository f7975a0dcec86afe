"""The page of SARAS 1992: published beside measured values, and errors in print."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sarcl import papers
from sarcl.cli import parser
from sarcl.opencl.choose_device import open_device
from sarcl.papers import far_radar
from sarcl.papers.lab import Lab
from sarcl.papers.saras import _errata, _patches, _speckle

MISPRINTED = {
    "HV over HH of tilted facets of a perfect conductor": [1, 0, 0],
    "phase of a triangle's integral about its centroid": None,
    "range-azimuth coupling at the edge of the band, xi 60": -0.283,
}
INTENSITY = "intensities of the image"


def test_errors_in_print_are_measured():
    rows = {row.item: row for row in _errata.section(None).rows}
    assert set(rows) == set(MISPRINTED) and all(row.cause == "error in print" for row in rows.values())
    for item, value in MISPRINTED.items():
        if value is not None:
            assert rows[item].value == pytest.approx(value, abs=0.01)
    one, other = rows["phase of a triangle's integral about its centroid"].value
    assert one == pytest.approx(-other, abs=1e-9) and abs(one) > 0.5


def test_22_patches_cover_the_field_and_touch_no_patch_of_like_material():
    number, electric = _patches.patches((72, 108))
    assert set(number.ravel()) == set(range(22)) and len(set(electric)) == 22
    eps, conductivity = np.array(electric).T
    assert (eps.min(), eps.max()) == (1, 40)  # figure 12's caption
    assert (conductivity.min(), conductivity.max()) == pytest.approx((1e-4, 1))
    beside = (number[:, 1:] != number[:, :-1]) & (np.abs(eps[number[:, 1:]] - eps[number[:, :-1]]) < 3)
    assert not beside.any()
    for i in range(22):
        assert (number[_patches.interior(number, i)] == i).all() and _patches.interior(number, i).sum() >= 100


def test_speckle_tells_rayleigh_amplitudes_from_others():
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((40, 40)) + 1j * rng.standard_normal((40, 40))
    found = far_radar.speckle(noise)
    assert found.rayleigh > 0.01 and found.uniform > 0.01 and found.contrast == pytest.approx(1, abs=0.1)
    assert far_radar.speckle(noise**2).rayleigh < 1e-6 and far_radar.speckle(np.abs(noise)).uniform < 1e-6


def test_table_1_follows_from_the_size_of_a_pixel(monkeypatch):
    monkeypatch.setitem(_speckle.CELLS, True, (64, 64))
    section = _speckle.section(Lab(open_device(None), quick=True))
    assert {row.item for row in section.rows if not row.holds} == {INTENSITY}
    assert np.sinc(section.numbers["pixel_in_nulls"]) == pytest.approx([0.51, 0.70], abs=1e-4)


@pytest.mark.slow
def test_the_command_writes_a_page_on_which_all_but_the_errata_agree(tmp_path):
    assert parser.main(["papers", "saras", "--quick", "-o", str(tmp_path)]) == 0
    document = json.loads((tmp_path / "saras.json").read_text())
    rows = [row for section in document["sections"] for row in section["rows"]]
    causes = dict.fromkeys(MISPRINTED, "error in print") | {INTENSITY: "interpretation"}
    assert document["finished"] and {row["item"]: row["cause"] for row in rows if not row["holds"]} == causes
    assert set(papers.find("saras").main) <= {row["item"] for row in rows}
    text = (tmp_path / "saras.html").read_text()
    assert text.index("Conclusion") < text.index("<figure") < text.index("Published and measured")
    assert "sarcl papers saras --quick" in text and "A quick run" in text
