"""The page of SARAS 1992: published beside measured values, and errors in print."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sarcl import papers
from sarcl.cli import parser
from sarcl.papers import far_radar

MISPRINTED = {
    "HV over HH of tilted facets of a perfect conductor": [1, 0, 0],
    "phase of a triangle's integral about its centroid": None,
    "range-azimuth coupling at the edge of the band, xi 60": -0.283,
}
INTENSITY = "intensities of the image"


def test_errors_in_print_are_measured():
    *_, errors_in_print = papers.find("saras").sections
    rows = {row.item: row for row in errors_in_print(None).rows}
    assert set(rows) == set(MISPRINTED) and all(row.cause == "error in print" for row in rows.values())
    for item, value in MISPRINTED.items():
        if value is not None:
            assert rows[item].value == pytest.approx(value, abs=0.01)
    one, other = rows["phase of a triangle's integral about its centroid"].value
    assert one == pytest.approx(-other, abs=1e-9) and abs(one) > 0.5


def test_speckle_tells_rayleigh_amplitudes_from_others():
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((40, 40)) + 1j * rng.standard_normal((40, 40))
    found = far_radar.speckle(noise)
    assert found.rayleigh > 0.01 and found.uniform > 0.01 and found.contrast == pytest.approx(1, abs=0.1)
    assert far_radar.speckle(noise**2).rayleigh < 1e-6 and far_radar.speckle(np.abs(noise)).uniform < 1e-6


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:point_roughness moves posts:sarcl.SarclWarning")  # four facets a pixel, as in print
def test_the_command_writes_a_page_on_which_all_but_the_errata_agree(tmp_path):
    assert parser.main(["papers", "saras", "--quick", "-o", str(tmp_path)]) == 0
    document = json.loads((tmp_path / "saras.json").read_text())
    rows = [row for section in document["sections"] for row in section["rows"]]
    numbers = {section["key"]: section["numbers"] for section in document["sections"]}
    assert np.sinc(numbers["speckle"]["pixel_in_nulls"]) == pytest.approx([0.51, 0.70], abs=1e-4)  # table I
    # |R|^2 of 22 materials, eps_r 1 to 40 and 1e-4 to 1 S/m: all differ
    assert len(set(numbers["patches"]["reflected"])) == 22
    causes = dict.fromkeys(MISPRINTED, "error in print") | {INTENSITY: "interpretation"}
    assert document["finished"] and {row["item"]: row["cause"] for row in rows if not row["holds"]} == causes
    assert set(papers.find("saras").main) <= {row["item"] for row in rows}
    text = (tmp_path / "saras.html").read_text()
    assert text.index(">Terms that") < text.index("Conclusion") < text.index("<figure")
    assert f"{len(MISPRINTED) + 1} differ: {len(MISPRINTED)} errors in print, 1 difference of interpretation." in text
    assert "sarcl papers saras --quick" in text and "A quick run" in text
