"""Plots and pages: positions of marks, curves that are distinguished without colour, text that is escaped."""

import re
import subprocess
import sys
from base64 import b64decode
from io import BytesIO
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

import sarcl
from sarcl.figures import html, plots


def pixels(png):
    with Image.open(BytesIO(png)) as image:
        return np.asarray(image.convert("RGB")).astype(int)


@pytest.fixture
def figures(monkeypatch):
    """The matplotlib figures that are made."""
    made, png = [], plots.png
    monkeypatch.setattr(plots, "png", lambda figure, *rest: made.append(figure) or png(figure, *rest))
    return made


def test_curves_differ_in_line_marker_and_width_not_in_colour_alone(figures):
    plots.curves([(str(i), np.arange(50), np.arange(50) + i) for i in range(6)], "x", "y")
    lines = figures[0].axes[0].get_lines()
    for name in ("get_linestyle", "get_marker", "get_linewidth", "get_markersize", "get_color"):
        found = [getattr(line, name)() for line in lines]
        dashes = [line._unscaled_dash_pattern for line in lines]
        assert len(set(map(str, dashes if name == "get_linestyle" else found))) == 6, name
    assert [text.get_text() for text in figures[0].axes[0].get_legend().get_texts()] == list("012345")


def test_a_curve_is_drawn_where_its_numbers_are(figures):
    x = np.linspace(-3, 5, 50)
    made = pixels(plots.curves([("a", x, x**2)], "x & y", "<m>"))
    axes = figures[0].axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x & y", "<m>") and axes.get_legend() is None
    column, row = axes.transData.transform((5.0, 25.0))
    blue = made[..., 2] - made[..., 0] > 60
    near = np.argwhere(blue)
    assert np.abs(near - [made.shape[0] - row, column]).sum(axis=1).min() < 6


def test_a_logarithmic_axis_is_ticked_at_one_two_and_five(figures):
    plots.curves([("a", [1, 10, 100], [0, 1, 2])], "x", "y", log_x=True)
    axis = figures[0].axes[0].xaxis
    shown = [
        label.get_text() for label, at in zip(axis.get_ticklabels(), axis.get_ticklocs(), strict=True) if 1 <= at <= 100
    ]
    assert shown == ["1", "2", "5", "10", "20", "50", "100"]


def texts_at(axis):
    return [label.get_text().replace("\N{MINUS SIGN}", "-") for label in axis.get_ticklabels()]


@pytest.mark.parametrize(
    "y", [(13.9449, 13.94491), (1.39449e6, 1.394491e6), (-3e-7, 2e-7), (0.0, 0.0), (2e7, 9e7), (0.12, 0.33)]
)
def test_ticks_have_whole_values_without_offset_or_common_power(figures, y):
    plots.curves([("a", [0, 1], y)], "x", "y")
    axes = figures[0].axes[0]
    assert [axis.get_offset_text().get_text() for axis in (axes.xaxis, axes.yaxis)] == ["", ""]
    values = axes.yaxis.get_ticklocs()
    assert [float(text) for text in texts_at(axes.yaxis)] == pytest.approx(list(values), rel=1e-6, abs=1e-12)
    assert len(set(texts_at(axes.yaxis))) == len(values)
    low, high = axes.get_ylim()
    assert high - low >= 0.999 * plots.LEAST_SPAN * max(map(abs, y)) and low <= min(y) <= max(y) <= high


def test_twenty_curves_have_twenty_looks():
    looks = [plots.style(i) for i in range(20)]
    assert len({(look["color"], look["linestyle"], look["marker"]) for look in looks}) == 20
    assert len({(look["linestyle"], look["marker"]) for look in looks}) == 20  # without colours


def test_one_point_is_a_marker_with_its_value_and_no_curve(figures):
    plots.curves([("dip", [0.2], [13.94494]), ("law", [0.1, 0.3], [1, 20])], "x", "y")
    plots.curves([("dip", [0.2], [13.94494])], "x", "y")
    one, law = figures[0].axes[0].get_lines()
    assert (one.get_linestyle(), law.get_linestyle()) == ("None", "--") and one.get_marker() == "o"
    names = [[text.get_text() for text in f.axes[0].get_legend().get_texts()] for f in figures]
    assert names == [["dip: 13.94", "law"], ["dip: 13.94"]]


def test_compared_figures_have_the_axes_they_are_given_and_no_legend_covers_the_frame(figures):
    values = [[0.0, 2.0], [1.0, 9.0]]
    limits = plots.ends([[0, 4]]), plots.ends(values)
    for y in values:
        plots.curves([("a", [0, 4], y), ("b", [1, 3], y)], "x", "y", limits=limits)
    plots.picture(np.eye(3), plots.PlotAxis("x", 0, 1), plots.PlotAxis("y", 0, 1), lines=[("edge", [0, 1], [0, 1])])
    first, second, picture = (figure.axes[0] for figure in figures)
    assert first.get_xlim() == second.get_xlim() == pytest.approx((-0.2, 4.2))
    assert first.get_ylim() == second.get_ylim() == pytest.approx((-0.45, 9.45))
    assert plots.ends([]) is None and plots.ends([[3.0]]) == pytest.approx((2.997, 3.003))
    for axes in (first, picture):
        assert axes.get_legend().get_window_extent().y0 >= axes.get_window_extent().y1 - 1
        assert axes.get_legend().get_window_extent().y1 <= axes.figure.bbox.y1 + 1


def test_chosen_curves_are_dots(figures):
    curves = [("law", [0, 1], [0, 1]), ("found", [0, 1], [0, 1])]
    plots.curves(curves, "x", "y", dots=("found",))
    plots.curves(curves, "x", "y", dots=True)
    assert [[line.get_linestyle() for line in f.axes[0].get_lines()] for f in figures] == [["-", "None"], ["None"] * 2]


def test_a_picture_shows_its_first_row_at_the_bottom_white_on_top_of_its_scale(figures):
    db = np.array([[0.0, -10.0], [-20.0, -80.0], [-40.0, -40.0]])
    made = pixels(plots.picture(db, plots.PlotAxis("x", 0, 2), plots.PlotAxis("y", 0, 3), box=(0.5, 0.5)))
    axes = figures[0].axes[0]
    for place, level in (((0.8, 0.8), 255), ((1.5, 0.5), 191), ((0.5, 1.5), 128), ((1.5, 1.5), 0), ((0.5, 2.5), 0)):
        column, row = axes.transData.transform(place)
        assert made[round(made.shape[0] - row), round(column)] == pytest.approx([level] * 3, abs=2)
    box = axes.patches[0]
    assert (box.get_xy(), box.get_width(), box.get_height()) == ((-0.5, -0.5), 1.0, 1.0)


@pytest.mark.parametrize("x, y", [((-40.0, 40.0), (-15.0, 15.0)), ((-10.0, 10.0), (-12.0, 12.0)), ((0, 1), (0, 30))])
def test_axes_of_equal_units_have_equal_scales(figures, x, y):
    plots.picture(np.zeros((3, 4)), plots.PlotAxis("m", *x), plots.PlotAxis("m", *y), equal=True)
    axes = figures[0].axes[0]
    corners = axes.transData.transform([(x[0], y[0]), (x[1], y[1])])
    across, up = np.diff(corners, axis=0)[0] / (x[1] - x[0], y[1] - y[0])
    assert across == pytest.approx(up, rel=1e-6)


def test_a_scale_that_is_not_in_decibels_gives_its_values_at_white_and_black():
    block = html.picture([[-0.4, 0.0], [0.2, 0.4]], (0, 1), (0, 1), "x", "y", "A.", floor_db=-0.8, unit="of the peak")
    assert block["caption"] == "A. White: 0.4; black: -0.4 of the peak."
    assert "black: 30 dB below" in html.picture([[0, 1]], (0, 1), (0, 1), "x", "y", "A.", floor_db=-30)["caption"]


def test_a_page_escapes_its_text_and_names_what_made_it():
    blocks = [
        html.heading("A & b", 3, "top"), html.words("<p>"), html.words("small", note=True), html.listed(["1 < 2", "x"]),
        html.terms([("dB", "10 log10 & so on")]),
        html.terms([("m", "metre")], "Folded"),
        html.table(["<h>", "n"], [["a & b", 1.5], ["c", "d"]], "c < d", marked=[1]),
        html.plot([("a", [0, 1], [0, 1])], "x", "y", "caption > 0"),
    ]  # fmt: skip
    text = html.page("T <&>", blocks, "sarcl 'x'")
    tree = ElementTree.fromstring(text.replace("<!doctype html>", ""))
    assert tree.find("head/title").text == tree.find("body/h1").text == "T <&>"
    made, size = "".join(tree.find("body/p").itertext()).split("\n")
    assert made == f"Made by sarcl {sarcl.__version__}: sarcl 'x'"
    assert size.startswith(f"One file of {len(text.encode()) / 1e6:.2f} MB")
    assert not [n.tag for n in tree.iter() if n.tag in ("link", "script", "iframe", "a")] and "http" not in text
    assert tree.find(".//h3").attrib["id"] == "top" and [n.text for n in tree.findall(".//li")] == ["1 < 2", "x"]
    assert [[c.text for c in row] for row in tree.iter("tr")] == [["<h>", "n"], ["a & b", "1.5"], ["c", "d"]]
    assert (
        tree.findall(".//tr")[2].attrib == {"class": "marked"} and tree.find(".//p[@class='caption']").text == "c < d"
    )
    assert [[n.text for n in d.iter() if n.text] for d in tree.iter("details")] == [["Folded", "m", "metre"]]
    figure = tree.find(".//figure")
    assert figure.find("figcaption").text == "caption > 0" and figure.find("img").attrib["alt"] == "y against x: a"
    kind, data = figure.find("img").attrib["src"].split(",")
    assert kind == "data:image/png;base64" and pixels(b64decode(data)).shape == (480, 672, 3)


def test_a_strip_leads_to_one_figure_of_each_section_pictures_first():
    picture = [html.picture([[0.0, -9.0]], (0, 1), (0, 1), "x", "y", f"P{i}. More.") for i in range(3)]
    plot = [html.plot([("a", [0, 1], [0, 1])], "x", "y", f"C{i}.") for i in range(9)]
    few = [html.heading("A"), plot[0], picture[0], html.heading("B"), plot[1], html.heading("C"), html.words("no")]
    entries = html.strip(few)[0]["figures"]
    assert [text for _, _, text in entries] == ["P0", "C0", "C1"]
    tree = ElementTree.fromstring(html.page("T", [*html.strip(few), *few]).replace("<!doctype html>", ""))
    links = {a.attrib["href"][1:]: a.find("img").tail for a in tree.findall(".//div[@class='strip']/a")}
    shown = {figure.attrib["id"]: figure.find("figcaption").text for figure in tree.iter("figure")}
    assert set(links) == set(shown) and all(shown[key].startswith(text) for key, text in links.items())
    assert list(shown.values()) == [picture[0]["caption"], "C0.", "C1."]  # pictures before plots in a run of figures
    assert pixels(b64decode(entries[0][1])).shape[1] == html.THUMBNAIL
    many = [block for i in range(9) for block in (html.heading(str(i)), plot[i], *picture[i : i + 1])]
    assert [text for _, _, text in html.strip(many)[0]["figures"]] == ["P0", "P1", "P2", "C3", "C4", "C5", "C6", "C7"]
    same = [html.heading("A"), {**plot[0]}, html.heading("B"), {**plot[0]}]
    assert [text for _, _, text in html.strip(same)[0]["figures"]] == ["A: C0", "B: C0"]
    assert html.strip([html.words("no figure")]) == []
    chosen = html.picture([[0.0, -9.0]], (0, 1), (0, 1), "x", "y", "P9.", chosen=True)
    targets = [block for name in "ABCD" for block in (html.heading(name), *picture[:1], {**chosen})]
    assert [text for _, _, text in html.strip(targets)[0]["figures"]] == [f"{name}: P9" for name in "ABCD"]


def test_a_table_of_words_has_groups_notes_and_the_head_of_every_cell():
    rows = [["a", ("1 m", "(table 1)")], ["b", ("2 m", "")]]
    block = html.table(["item", "value"], rows, text=True, groups={1: "Others <&>"})
    tree = ElementTree.fromstring(html.page("T", [block]).replace("<!doctype html>", ""))
    assert ["".join(row.itertext()).split() for row in tree.findall(".//tbody/tr")] == [
        ["a1", "m", "(table", "1)"], ["Others", "<&>"], ["b2", "m"],
    ]  # fmt: skip
    assert [cell.attrib["data-head"] for cell in tree.iter("td")] == ["item", "value"] * 2
    assert tree.find(".//tr[@class='group']/th").attrib["colspan"] == "2" and tree.find(".//small").text == "(table 1)"
    assert len(tree.findall(".//small")) == 1


def test_colours_of_a_page_have_contrast_in_light_and_in_dark():
    """Contrast of text and background as WCAG 2 defines it, 4.5 or more: luminance is that of sRGB."""

    def luminance(colour):
        digits = colour if len(colour) == 6 else "".join(2 * digit for digit in colour)
        v = np.array([int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4)])
        return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722]

    palettes = [
        {name: luminance(colour) for name, colour in re.findall(r"--(\w+): #(\w+);", line)}
        for line in html.page("T", []).splitlines()
        if ":root" in line
    ]
    assert len(palettes) == 2 and palettes[0]["paper"] > 0.9 and palettes[1]["paper"] < 0.05
    for palette in palettes:
        for text in ("ink", "faint", "link"):
            for ground in ("paper", "mark", "group"):
                bright, dark = sorted((palette[text], palette[ground]), reverse=True)
                assert (bright + 0.05) / (dark + 0.05) >= 4.5, (text, ground)


def test_pictures_of_the_base_install_need_no_extra_and_plots_no_pyplot():
    code = (
        "import sys, numpy as np; from sarcl.figures import decibels, plots\n"
        "decibels.picture(np.zeros((4, 5))); assert not {'matplotlib', 'jinja2'} & set(sys.modules)\n"
        "plots.curves([('a', [0, 1], [0, 1])], 'x', 'y'); assert 'matplotlib.pyplot' not in sys.modules"
    )
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_missing_packages_are_named_with_the_command_to_install_them(monkeypatch):
    plots.require("this page")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "jinja2" else name)
    with pytest.raises(ImportError, match=r"this page needs jinja2, of the extra plots: pip install 'sarcl\[plots\]'"):
        plots.require("this page")
