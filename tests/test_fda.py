"""The experiment harness: what it measures on curves that are known, and what it says of apertures."""

from __future__ import annotations

import json
from xml.etree import ElementTree

import numpy as np
import pytest

from sarcl import cli, fda, fda_file, fda_page, page
from sarcl.check import SPEED_OF_LIGHT
from sarcl.fda import Case

# 16 channels of 50 MHz; the same resolution as Farooq's, in a tenth of the pulses
QUICK = {"n": 16, "frequency_step": 50e6, "n_pulses": 44, "aperture": 43.0, "distance": 500.0}


def sinc(at, null, place=0.0):
    return np.abs(np.sinc((at - place) / null))


def test_widths_and_lobes_of_a_sinc():
    at = np.linspace(-2.4, 2.4, 961)
    found = fda.response(at, sinc(at, 0.2, 0.05), 0.05)
    assert found["error"] == pytest.approx(0, abs=1e-3) and found["level_db"] == pytest.approx(0, abs=1e-3)
    assert found["null"] == pytest.approx(0.2, rel=5e-3) and found["irw"] == pytest.approx(0.886 * 0.2, rel=5e-3)
    assert found["pslr_db"] == pytest.approx(-13.26, abs=0.02) and found["islr_db"] == pytest.approx(-9.9, abs=0.3)


def test_dips_are_there_only_where_there_are_two_peaks():
    at = np.linspace(-3, 3, 2401)
    pair = lambda s: np.abs(np.sinc((at - s / 2) / 0.2) + np.sinc((at + s / 2) / 0.2))  # noqa: E731
    for separation in (0.05, 0.1, 0.2):
        assert fda.dip(at, pair(separation), separation) == 0
    middle = 2 * np.sinc(0.15 / 0.2)
    peak = pair(0.3)[np.abs(at - 0.15) < 0.1].max()
    assert fda.dip(at, pair(0.3), 0.3) == pytest.approx(20 * np.log10(peak / middle), abs=0.5)
    assert fda.dip(at, pair(0.4), 0.4) > 20


@pytest.fixture(scope="module")
def measured():
    case = Case("quick", points=(0.0, 0.63), separations=(0.1, 0.125, 0.3), **QUICK)
    return case, fda.measure(case)


def test_the_centre_narrows_and_nothing_else_does(measured):
    case, found = measured
    rows = found["mapped"]
    plain, apparent, own = (rows[name] for name in ("conventional", "apparent", "channels"))
    assert plain["points"][0]["null"] == pytest.approx(case.null, rel=0.03)
    assert apparent["points"][0]["null"] < 0.95 * plain["points"][0]["null"]
    assert apparent["length"] > 1.03 * plain["length"] and apparent["gap"] > 2.0
    # what was collected is what the conventional antenna collects
    assert own["claimed"] == pytest.approx(plain["claimed"], rel=0.03) and apparent["claimed"] > 1.02 * plain["claimed"]
    assert abs(apparent["points"][1]["error"]) > 0.3 * case.null
    for row in (plain, own):
        assert abs(row["points"][1]["error"]) < 0.02 * case.null
    assert [d["dip_db"] for d in apparent["dips"]][:2] == [0, 0] == [d["dip_db"] for d in plain["dips"]][:2]
    assert plain["dips"][2]["dip_db"] > 3
    assert rows["unmodified"]["points"][0]["level_db"] < -0.3
    json.dumps(found)


def test_the_page_says_what_was_gained_and_what_was_not(measured):
    _, found = measured
    text = fda_page.html([found], "Apertures <&>")
    tree = ElementTree.fromstring(text.replace("<!doctype html>", "").replace('<meta charset="utf-8">', ""))
    said = "".join(tree.itertext())
    assert "Apertures <&>" in said and "nearer than the conventional antenna's" in said and "comes out" in said
    assert "Two points are told apart from 0.3 m on (conventional: from 0.3 m on)" in said
    assert len(tree.findall(".//svg")) == 4 and len(tree.findall(".//table")) == 3
    assert len(tree.findall(".//table")[0]) == 1 + len(found["mapped"])


def test_drawings_keep_to_their_frame():
    x = np.linspace(-3, 5, 50)
    tree = ElementTree.fromstring(page.plot([("a", x, x**2), ("b", x, -x)], "x & y", "<m>", "caption"))
    box = tree.find(".//rect").attrib
    left, top, wide, high = (float(box[k]) for k in ("x", "y", "width", "height"))
    for line in tree.findall(".//polyline"):
        points = np.array([p.split(",") for p in line.attrib["points"].split()], float)
        assert (points >= [left - 0.1, top - 0.1]).all() and (points <= [left + wide + 0.1, top + high + 0.1]).all()
    assert [t.text for t in tree.findall(".//text")][-2:] == ["x & y", "<m>"]


def test_the_command_writes_a_page_and_its_numbers(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    keys = "\n".join(f"{k} = {v}" for k, v in QUICK.items())
    (tmp_path / "try.toml").write_text(
        f'[fda]\ntitle = "Two tries"\nmappings = ["corrected"]\npoints = [0.0]\nseparations = [0.2]\n{keys}\n'
        '[[case]]\nname = "switched"\n[[case]]\nname = "steady"\nmirrored = false\n'
    )
    assert cli.main(["fda", "try.toml"]) == 0
    out = capsys.readouterr().out
    assert "steady: 16 elements" in out and "wrote try.html and try.json" in out
    numbers = json.loads((tmp_path / "try.json").read_text())
    assert [case["name"] for case in numbers] == ["switched", "steady"] and "<h1>Two tries</h1>" in (
        tmp_path / "try.html"
    ).read_text()


BAD = {
    "n = 1": "at least 2",
    "frequency_step = 0": "nothing to map",
    "spaceing = 0.1": "unknown key 'spaceing'; did you mean 'spacing'",
    "separations = [-0.1]": "some way apart",
    'mappings = ["sideways"]': "choose one of",
    "mirrored = 3": "true or false",
    "distance = nan": "finite",
    "n = ": "not valid TOML",
}


@pytest.mark.parametrize("line", BAD)
def test_bad_experiments_are_refused_with_their_case(tmp_path, line):
    path = tmp_path / "bad.toml"
    path.write_text(f"[fda]\n{line}\n")
    with pytest.raises(ValueError, match=BAD[line]) as found:
        fda_file.load(path)
    assert "bad.toml" in str(found.value)


def test_other_tables_and_missing_files_are_named(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text("[fdaa]\nn = 3\n")
    with pytest.raises(ValueError, match="unknown table 'fdaa'; did you mean 'fda'"):
        fda_file.load(path)
    with pytest.raises(FileNotFoundError, match="does not exist"):
        fda_file.load(tmp_path / "none.toml")


def test_half_a_wave_of_the_centre_frequency_is_the_default_spacing():
    case = Case("c")
    assert case.step == pytest.approx(SPEED_OF_LIGHT / 10.44e9 / 2)
    assert case.null == pytest.approx(0.167, abs=5e-4) and case.bandwidth == 900e6
