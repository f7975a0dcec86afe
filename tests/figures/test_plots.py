"""Plots and pages: positions of marks, curves that are distinguished without colour, text that is escaped."""

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
    figure = tree.find(".//figure")
    assert figure.find("figcaption").text == "caption > 0" and figure.find("img").attrib["alt"] == "y against x: a"
    kind, data = figure.find("img").attrib["src"].split(",")
    assert kind == "data:image/png;base64" and pixels(b64decode(data)).shape == (480, 672, 3)


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
