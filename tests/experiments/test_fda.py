"""Experiments on apertures: measurements of known curves, and the sentences of the report."""

from __future__ import annotations

import importlib.util
import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import sarcl
from sarcl import fda
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.cli import parser
from sarcl.experiments.fda import file as fda_file
from sarcl.experiments.fda import page as fda_page
from sarcl.experiments.fda import text as fda_text
from sarcl.experiments.fda.case import Case
from sarcl.experiments.fda.text import conclusion, setting

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
    tree = parsed(fda_page.html([found], "Apertures <&>", "sarcl fda a & b.toml"))
    said = "".join(tree.itertext())
    assert "Apertures <&>" in said and "closer to the peak than the conventional antenna's" in said
    assert "is displaced by" in said and "Two points are resolved at 0.3 m, the largest separation tried" in said
    # the mapped point's side lobes meet between the two
    assert "At 0.3 m there is a dip of 13.0 dB, but another peak reaches -2.4 dB of the lower of the two: 4 " in said
    assert len(tree.findall(".//figure")) == 4 and len(tree.findall(".//table")) == 4
    assert len(tree.find(".//table/tbody")) == len(found["mapped"])
    assert f"Made by sarcl {sarcl.__version__}: sarcl fda a & b.toml" in said


def test_pictures_and_the_table_of_all_cases_stand_on_top_and_the_terms_at_the_end(measured):
    tree = parsed(fda_page.html([measured[1]]))
    order = [node.tag if node.tag in ("figure", "table") else node.text for node in tree.iter()
             if node.tag in ("h2", "dl", "figure", "table")]  # fmt: skip
    cases = ["quick", *["figure"] * 4, *["table"] * 3]
    assert order == ["Conclusion", "table", *cases, "Mappings in words", "Terms", None, "About this page"]
    conclusion_node = tree.findall(".//p")[1]
    assert conclusion_node.text == "No mapping resolves two points closer together than the conventional antenna does."
    links = [link.attrib["href"] for link in tree.findall(".//div[@class='strip']/a")]
    assert links == [f"#{figure.attrib['id']}" for figure in tree.iter("figure")]
    assert tree.find(".//meta[@name='viewport']").attrib["content"] == "width=device-width, initial-scale=1"
    terms = {node.text for node in tree.findall(".//dt")}
    assert {"mapping", "null", "PSLR, ISLR", "dip", "resolved", "spatial frequencies"} <= terms


def test_a_gain_is_said_first(measured):
    found = json.loads(json.dumps(measured[1]))
    found["mapped"]["apparent"]["told_apart"] = 0.1
    for dip in found["mapped"]["apparent"]["dips"]:
        dip |= APART
    said = conclusion([found, found])
    assert (
        said[0]
        == "Two points are resolved closer together than by the conventional antenna with apparent in 2 of 2 cases."
    )
    assert "points displaced by at most" in said[3] and "closer together in 2 of 2 cases" in said[3]


def test_points_off_the_centre_have_widths_of_their_own(measured):
    _, found = measured
    off = found["mapped"]["apparent"]["points"][1]
    tree = parsed(fda_page.html([found]))
    rows = [[cell.text for cell in row] for row in tree.findall(".//table")[2].iter("tr")]
    apparent = next(row for row in rows if row[0] == "apparent")
    assert rows[0][1:3] == ["y, m", "error of position, m"] and len(rows) == 1 + len(found["mapped"])
    assert apparent[1] == "0.63" and float(apparent[2]) == pytest.approx(off["error"], abs=1e-3)
    assert [float(v) for v in apparent[4:6]] == pytest.approx([off["null"], off["irw"]], abs=1e-4)


def parsed(text):
    return ElementTree.fromstring(text.replace("<!doctype html>", ""))


APART = {"dip_db": 20.0, "shift": 0.01, "false_db": -10.0, "level_db": 0.0, "peaks": [-0.2, 0.2]}
SPOILED = {
    "dip": ({"dip_db": 2.9}, "the dip is 2.9 dB (3 dB are needed)"),
    "place": ({"shift": 0.06}, "a peak is displaced by 0.060 m (0.050 m are allowed)"),
    "count": ({"false_db": -2.0, "peaks": [-0.2, 0.0, 0.2]}, "another peak reaches -2.0 dB of the lower of the two: 3"),
    "level": ({"level_db": -7.0}, "the lower peak is at -7.0 dB (-6 dB are needed)"),
}


@pytest.mark.parametrize("spoiled, why", SPOILED.values(), ids=SPOILED)
def test_two_points_are_resolved_by_as_many_peaks_in_their_places(spoiled, why):
    assert fda_text.unresolved(APART, 0.2) == []
    assert fda_text.unresolved(APART | spoiled, 0.2)[0].startswith(why)
    dips = [{"separation": s, **APART} for s in (0.3, 0.4, 0.5)]
    assert fda.told_apart(dips, 0.2) == 0.3
    assert fda.told_apart([dips[0], dips[1] | spoiled, dips[2]], 0.2) == 0.5  # and stay so
    assert fda.told_apart([dips[0], dips[1], dips[2] | spoiled], 0.2) is None


def test_false_peaks_and_displaced_ones_are_measured():
    at = np.linspace(-1, 1, 2001)
    lobe = lambda place, high: high * np.exp(-(((at - place) / 0.03) ** 2))  # noqa: E731
    found = fda.pair(at, lobe(-0.12, 1.0) + lobe(0.1, 0.9) + lobe(0.5, 0.45), 0.2)
    assert found["shift"] == pytest.approx(0.02, abs=1e-3) and found["dip_db"] > 15
    assert found["false_db"] == pytest.approx(20 * np.log10(0.5), abs=0.01)
    assert found["level_db"] == pytest.approx(20 * np.log10(0.9), abs=0.01)
    np.testing.assert_allclose(found["peaks"], [-0.12, 0.1], atol=1e-3)
    # four peaks, the two brightest far from the points
    four = lobe(-0.28, 1.0) + lobe(-0.1, 0.8) + lobe(0.1, 0.8) + lobe(0.28, 1.0)
    found = fda.pair(at, four, 0.3)
    assert found["dip_db"] > 15 and found["shift"] == pytest.approx(0.13, abs=1e-3) and len(found["peaks"]) == 4
    assert not fda.is_resolved(found, 0.167)
    # a level that rises to the end of the cut is of a peak beyond it
    assert fda.is_resolved(fda.pair(at, lobe(-0.1, 1.0) + lobe(0.1, 1.0), 0.2), 0.1)
    found = fda.pair(at, lobe(-0.1, 1.0) + lobe(0.1, 1.0) + lobe(1.01, 1.5), 0.2)
    assert found["false_db"] > 0 and not fda.is_resolved(found, 0.1)


def test_a_cut_without_a_position_at_a_point_is_refused_by_name():
    with pytest.raises(ValueError, match=r"separation is 0\.1 m, and `at` has no position .* closer together"):
        fda.pair(np.linspace(-1, 1, 11), np.ones(11), 0.1)


def test_one_peak_has_neither_error_of_position_nor_others_beside_it():
    at = np.linspace(-1, 1, 401)
    found = fda.pair(at, np.exp(-((at / 0.3) ** 2)), 0.2)
    assert found["dip_db"] == 0 and found["shift"] is None and found["false_db"] is None
    assert found["peaks"] == pytest.approx([0.0], abs=1e-9) and fda_text.unresolved(found, 0.2) == [
        "1 peak for 2 points"
    ]


# What mappings do in other geometries. A conventional antenna's half-power width is .886 of its null width.
SMALL = {**QUICK, "points": (0.0,), "separations": (0.3,)}


def rows_of(**fields):
    found = fda.measure(Case("try", **{**SMALL, **fields}))
    return found, {name: row["points"][0] for name, row in found["mapped"].items()}


@pytest.mark.slow
def test_half_power_widths_are_those_of_published_truth(tmp_path):
    # 10 GHz, 10 km, 100 m (100 steps of 1 m), widths as in test_aperture.py; what resolves is where phase centres are
    (tmp_path / "wide.toml").write_text(
        "[fda]\ncenter = 9.825e9\nfrequency_step = 50e6\nn = 8\nmirrored = false\ndistance = 10e3\n"
        'aperture = 99.0\nn_pulses = 100\nmappings = ["channels"]\npoints = [0.0]\nseparations = [2.0]\n'
        '[[case]]\nname = "small"\nreceive = "own"\n[[case]]\nname = "own"\nspacing = 10.0\nreceive = "own"\n'
        '[[case]]\nname = "all"\nspacing = 10.0\nreceive = "all"\n[[case]]\nname = "one"\nspacing = 10.0\n'
    )
    for case, width in zip(fda_file.load(tmp_path / "wide.toml")[1], (1.327, 1.056, 1.172, 1.242), strict=True):
        found = fda.measure(case)
        assert case.is_wide == (case.name != "small") == ("conventional array with" in setting(found))
        for name in ("conventional", "channels"):
            assert found["mapped"][name]["points"][0]["irw"] == pytest.approx(width, abs=0.004), (case.name, name)


def test_what_does_not_apply_is_said_with_the_reason():
    found, rows = rows_of(progression="costas")
    assert set(found["not_applicable"]) == {"apparent"} and "apparent" not in rows
    said = "".join(parsed(fda_page.html([found])).itertext())
    assert "apparent: not applicable." in said and "even steps along a line" in said
    # with separated channels there is nothing to map, and elements of one carrier cannot be separated
    found, rows = rows_of(receive="own")
    assert set(found["not_applicable"]) == {"unmodified", "corrected", "apparent"} and set(rows) > {"channels"}
    found, rows = rows_of(progression="planar", n=(4, 2), frequency_step=(50e6, 0))
    assert "share carriers" in found["not_applicable"]["channels"] and "unmodified" in rows
    json.dumps(found)


def test_costas_channels_resolve_as_a_conventional_antenna_does():
    _, rows = rows_of(progression="costas")
    for name in ("channels", "corrected"):
        assert rows[name]["null"] == pytest.approx(rows["conventional"]["null"], rel=0.01)
        assert rows[name]["pslr_db"] == pytest.approx(-13.3, abs=0.1) and rows[name]["level_db"] > -0.01
    assert rows["unmodified"]["level_db"] < -0.3


def test_a_squint_widens_by_its_cosine():
    widths = [rows_of(squint=s, mappings=("channels",))[1] for s in (0.0, 0.5, 1.0)]
    for name in ("conventional", "channels"):
        for row, squint in zip(widths, (0.0, 0.5, 1.0), strict=True):
            assert row[name]["irw"] * np.cos(squint) == pytest.approx(widths[0][name]["irw"], rel=0.01)
            assert abs(row[name]["error"]) < 1e-3 and row[name]["level_db"] > -0.01


def test_on_a_circle_the_centre_is_focused_as_it_is_and_the_mapping_narrows_it_all_the_same():
    found, rows = rows_of(path="circle", aperture=200.0, n_pulses=200, separations=(0.06,))
    # K spreads over 2 sin(arc/2) of 2 f/c
    null = SPEED_OF_LIGHT / found["middle"] / (4 * np.sin(0.2))
    assert rows["conventional"]["null"] == pytest.approx(null, rel=0.03) and found["null"] == pytest.approx(null)
    for name in ("unmodified", "corrected", "channels"):
        assert rows[name]["irw"] == pytest.approx(rows["conventional"]["irw"], rel=0.01)
        assert rows[name]["level_db"] > -0.05
    mapped = found["mapped"]
    assert mapped["apparent"]["claimed"] > 1.01 * found["collected"]["claimed"]
    assert rows["apparent"]["null"] < 0.98 * rows["conventional"]["null"]
    assert "An arc of 200 m" in setting(found)


def test_steps_across_the_track_move_a_point_in_range_only():
    low, high = (rows_of(progression="vertical", height=h)[1] for h in (0.0, 300.0))
    # at the height of the track nothing differs; above it points move in range by 0.93 m, off the cut
    assert low["unmodified"]["level_db"] > -0.01 and high["unmodified"]["level_db"] < -10
    for name in ("corrected", "channels", "apparent"):
        assert high[name]["irw"] == pytest.approx(low["conventional"]["irw"], rel=0.01)
    _, planar = rows_of(progression="planar", n=(4, 4), frequency_step=(50e6, 200e6), height=300.0)
    assert planar["channels"]["irw"] == pytest.approx(low["conventional"]["irw"], rel=0.01)
    assert planar["unmodified"]["level_db"] < -10


def test_side_lobes_of_points_displaced_in_range_are_not_two_points_resolved():
    found, _ = rows_of(progression="vertical", height=300.0, mappings=("unmodified",), separations=(0.4,))
    row = found["mapped"]["unmodified"]
    pair, tolerance = row["dips"][0], found["resolved_if"]
    # all that can be seen on the cut but their level: 0.93 m off in range, the points are not on it
    assert pair["dip_db"] > 10 and pair["shift"] < tolerance["shift"] and pair["false_db"] < tolerance["false_db"]
    assert len(pair["peaks"]) == 2 and pair["level_db"] < -20
    assert row["told_apart"] is None and not pair["resolved"]
    said = " ".join(fda_text.verdicts(found))
    assert "resolved at no separation tried" in said and "the lower peak is at -27.2 dB (-6 dB are needed)" in said


@pytest.mark.slow
def test_four_peaks_of_450_channels_are_not_two_points_resolved():
    # as published for its nulls, 0.100 m; two points 0.3 m apart are another matter
    case = Case("N 450", n=450, frequency_step=2e6, mappings=("apparent",), points=(0.0,), separations=(0.25, 0.3))
    found = fda.measure(case)
    apparent, plain = (found["mapped"][name] for name in ("apparent", "conventional"))
    assert plain["told_apart"] == 0.3 and len(plain["dips"][1]["peaks"]) == 2
    assert apparent["told_apart"] is None
    places = apparent["dips"][1]["peaks"]
    assert len(places) == 4 and max(places) == pytest.approx(0.283, abs=0.005) == -min(places)
    said = " ".join(fda_text.verdicts(found))
    assert "4 peaks within 3 dB for 2 points, at -0.28" in said and "displaced by 0.133 m (0.042 m are allowed)" in said
    page = "".join(parsed(fda_page.html([found])).itertext())
    assert "Not resolved in spite of their dip: apparent at 0.3 m." in page
    assert "27.4, 4 peaks" in page and "12.7 resolved" in page and "each within 0.042 m of its point" in page


def test_subarrays_look_where_they_are_steered():
    groups = {"progression": "subarrays", "n": 32, "frequency_step": 25e6, "groups": 8, "squint": 0.6}
    found, ahead = rows_of(**groups)
    off = rows_of(**groups, steer=0.5, mappings=("channels",))[1]
    assert found["bandwidth"] == 800e6 and "8 groups" in setting(found)
    # 4 elements half a wave apart, their phases those of sin(squint + steer): the array factor at sin(squint)
    x = np.pi * (np.sin(1.1) - np.sin(0.6))
    factor = np.sin(2 * x) / (4 * np.sin(x / 2))
    assert ahead["channels"]["level_db"] > -0.1
    assert off["channels"]["level_db"] == pytest.approx(20 * np.log10(abs(factor)), abs=0.2)
    assert ahead["channels"]["irw"] == pytest.approx(ahead["conventional"]["irw"], rel=0.01)
    assert abs(ahead["channels"]["error"]) < 1e-3


def trend(tmp_path, steps):
    (tmp_path / "trend.toml").write_text(
        f'[fda]\nmappings = ["apparent"]\npoints = [0.0]\nseparations = [0.2]\n[sweep]\nbandwidth = 900e6\n'
        f"frequency_step = {steps}\n"
    )
    _, cases = fda_file.load(tmp_path / "trend.toml")
    points = [found["mapped"]["apparent"]["points"][0] for found in fda.run(cases)]
    return [case.n for case in cases], [(p["null"], p["pslr_db"]) for p in points]


# Farooq 2009, figures 5.9 to 5.11, as measured here: to millimetres and tenths of a decibel
def test_side_lobes_rise_as_the_frequency_step_falls(tmp_path):
    n, found = trend(tmp_path, [100e6, 20e6, 10e6])
    assert n == [9, 45, 90]
    np.testing.assert_allclose(found, [(0.164, -13.0), (0.156, -11.8), (0.148, -10.6)], atol=0.0015, rtol=0.006)


@pytest.mark.slow
def test_side_lobes_are_almost_as_high_as_the_peak_at_1_mhz(tmp_path):
    n, found = trend(tmp_path, [1e6])
    assert n == [900] and found[0] == pytest.approx((0.072, -2.6), rel=0.015)


def test_sweeps_make_a_case_of_every_combination():
    cases = fda.sweep(Case("a", **SMALL), frequency_step=[100e6, 50e6], aperture=[40.0, 50.0], bandwidth=800e6)
    assert [(c.n, c.frequency_step, c.aperture) for c in cases] == [
        (8, 100e6, 40), (8, 100e6, 50), (16, 50e6, 40), (16, 50e6, 50)
    ]  # fmt: skip
    assert cases[0].name == "a: frequency_step 100 MHz, aperture 40 m" and cases[0].series == "a"
    assert dict(cases[1].swept) == {"frequency_step": 100e6, "aperture": 50.0}
    counts = fda.sweep(Case("a", **SMALL), n=[8, 16], bandwidth=[400e6, 800e6])
    assert [c.frequency_step for c in counts] == [50e6, 100e6, 25e6, 50e6]
    assert [c.squint for c in fda.sweep(Case("a", **SMALL), squint=np.array([0.0, 0.5]))] == [0.0, 0.5]


def test_the_page_of_a_sweep_begins_with_its_table_and_trends(tmp_path):
    (tmp_path / "s.toml").write_text(
        "".join(f"{k} = {v}\n" for k, v in {"[fda]\nmappings": ["apparent", "channels"], **QUICK}.items())
        + "points = [0.0, 0.63]\nseparations = [0.2, 0.3]\n"
        + '[sweep]\nprogression = ["linear", "costas"]\nsquint_deg = [0.0, 60.0]\n'
    )
    results = fda.run(fda_file.load(tmp_path / "s.toml")[1])
    assert [round(r["swept"]["squint"], 6) for r in results] == [0, 1.047198] * 2
    tree = parsed(fda_page.html(results))
    table, body = tree.find(".//table"), "".join(tree.itertext())
    rows = ["|".join(cell.text or "" for cell in row) for row in table.iter("tr")]
    assert len(rows) == 1 + 4 * 3 and rows[2].startswith("linear|0 deg|apparent|0.13")
    assert sum("not applicable" in row for row in rows) == 2 and rows[-1].startswith("costas|60 deg|channels|")
    assert body.index("sweep of progression, squint") < body.index("case 1: progression linear")
    # five quantities against squint, for each progression; the sixth has a value at one squint, which is no curve
    figures = [f.find("figcaption") for f in tree.findall(".//figure")]
    trends = ["".join(f.itertext()) for f in figures if "progression" in "".join(f.itertext())]
    assert len(trends) == 10 and not any(title.startswith("resolved from") for title in trends)
    assert {row.split("|")[1] for row in rows[1:] if row.split("|")[8] not in ("none", "")} == {"0 deg"}
    assert "(apparent: none)" in [f.find("img").attrib["alt"] for f in tree.findall(".//figure")][9]
    said = conclusion(results)
    assert "(applies to 2 of 4 cases)" in said[1] and "Null of the first point 0.1" in said[2]
    unfinished = fda_page.html(results[:2], sections=[[], []], finished=False)
    assert "<figure" not in unfinished and "Not finished" in unfinished


def test_the_command_writes_a_page_and_its_numbers(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    keys = "\n".join(f"{k} = {v}" for k, v in QUICK.items())
    (tmp_path / "try.toml").write_text(
        f'[fda]\ntitle = "Two tries"\nmappings = ["corrected"]\npoints = [0.0]\nseparations = [0.2]\n{keys}\n'
        '[[case]]\nname = "switched"\n[[case]]\nname = "steady"\nmirrored = false\n'
    )
    assert parser.main(["fda", "try.toml"]) == 0
    out = capsys.readouterr().out
    assert "steady: 16 elements" in out and "wrote try.html and try.json" in out
    numbers = json.loads((tmp_path / "try.json").read_text())
    page = (tmp_path / "try.html").read_text()
    assert [case["name"] for case in numbers] == ["switched", "steady"]
    assert "<h1>Two tries</h1>" in page and "<code>sarcl fda try.toml</code>" in page and "Not finished" not in page


@pytest.mark.parametrize("command", [["fda", "try.toml"], ["papers", "farooq"]])
def test_a_page_without_its_extra_is_refused_with_the_command_to_install_it(tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "try.toml").write_text("[fda]\n")
    find, absent = importlib.util.find_spec, ("matplotlib", "jinja2")
    monkeypatch.setattr("importlib.util.find_spec", lambda name, *rest: None if name in absent else find(name, *rest))
    assert parser.main(command) == parser.FAILED
    said = capsys.readouterr().err
    assert "needs matplotlib and jinja2, of the extra plots: pip install 'sarcl[plots]'" in said
    assert said.count("\n") == 1 and [p.name for p in tmp_path.iterdir()] == ["try.toml"]


BAD = {
    "n = 1": "at least 2",
    "frequency_step = 0": "nothing to map",
    "spaceing = 0.1": "unknown key 'spaceing'; did you mean 'spacing'",
    "separations = [-0.1]": "some distance apart",
    'mappings = ["sideways"]': "choose one of",
    "mirrored = 3": "true or false",
    "distance = nan": "finite",
    "n = ": "not valid TOML",
    "n = [4, 4]": "progression 'linear' takes one value",
    'progression = "planar"': "takes two values, along the track and z",
    'progression = "spiral"': "choose one of",
    'progression = "costas"\nn = 48': "nearest sizes are 46 and 50",
    'progression = "subarrays"': "needs groups",
    'progression = "subarrays"\ngroups = 7': "equal groups",
    'progression = "subarrays"\ngroups = 9\nreceive = "own"': "a row holds a whole group",
    "groups = 9": "go with progression 'subarrays'",
    'progression = "planar"\nn = [4, 4]\nfrequency_step = [20e6, 7.3333e6]': "whole multiples of one step",
    "center = -1e9": "greater than 0",
    "center = 1e9\nfrequency_step = -30e6": "frequencies must be positive",
    "center = 1e9\nfrequency_step = -22.6e6": "frequencies must be positive",
    "squint_deg = 90": "resolves nothing across",
    "squint_deg = 5\nsquint = 0.1": "given twice",
    'squint_deg = "left"': "must be a number",
    'path = "circle"\nsquint = 0.1': "always at broadside",
    'path = "circle"\naperture = 40e3': "the whole circle",
    "height = 5e3": "give less",
    "points = [500.0]": "one sample per channel",
    'mappings = "apparent"': "give a list",
    'mappings = ["apparent", "apparent"]': "each of them once",
    "name = 3": "give a text",
    "separations = [2.1]": "the cut 2 m to each side",
    "aperture = 20.0": "separations go down to 0.1 m, but samples of the cut are 0.15 m apart",
    "[sweep]\nmirrored = [true, 3]": "mirrored 3: mirrored is 3; give true or false",
    'receive = "some"': "choose one of",
    "series = 3": "unknown key 'series'",
    "[sweep]": "a sweep without keys sweeps nothing",
    "[sweep]\nfrequncy_step = [1e6]": "unknown key 'frequncy_step'; did you mean 'frequency_step'",
    "[sweep]\nmappings = [1]": "unknown key 'mappings'",
    "[sweep]\naperture = []": "no values",
    "[sweep]\naperture = 3.0": "wants a list",
    "[sweep]\nbandwidth = 900e6": "sweeps nothing",
    "[sweep]\nbandwidth = 900e6\nfrequency_step = [100e6, 70e6]": "frequency_step 70 MHz: bandwidth is 9e",
    "[sweep]\nbandwidth = -9e8\nfrequency_step = [1e8]": "bandwidth is -9e",
    "[sweep]\nbandwidth = 9e8\nfrequency_step = [0]": "0 elements",
    "[sweep]\nbandwidth = 9e8\nn = [9, 1]": "n 1: n is 1",
    "[sweep]\nbandwidth = 9e8\nn = [9]\nfrequency_step = [1e8]": "depend on each other",
    "[sweep]\naperture = [430.0, -1.0]": "aperture -1 m: aperture is -1",
    f"[sweep]\naperture = {[float(i) for i in range(1, 10)]}\nn_pulses = {list(range(2, 11))}": "9 x 9 = 81 cases",
}


@pytest.mark.parametrize("line", BAD)
def test_bad_experiments_are_refused_with_their_case(tmp_path, line):
    path = tmp_path / "bad.toml"
    path.write_text(f"[fda]\n{line}\n")
    with pytest.raises(ValueError, match=re.escape(BAD[line])) as found:
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


def test_the_experiments_of_the_documentation_load_word_for_word(tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "guide" / "fda.md").read_text()
    files = re.findall(r"```toml\n(.*?)```", text, re.S)
    made = []
    for i, words in enumerate(files):
        (tmp_path / f"{i}.toml").write_text(words)
        made.append(fda_file.load(tmp_path / f"{i}.toml")[1])
    assert [len(cases) for cases in made] == [2, 5]
    # run as they stand but for what takes minutes: fewer points, and the first case
    fda.measure(replace(made[0][0], points=(0.0,), separations=(0.3,)))
    fda.measure(replace(made[1][0], points=(0.0,), separations=(0.3,)))
