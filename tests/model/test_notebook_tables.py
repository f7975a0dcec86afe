"""What notebooks and `print` show of objects, and their properties as arrays."""

from __future__ import annotations

from html.parser import HTMLParser

import numpy as np
import pytest

import sarcl

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=600e6, duration=1e-6)
TRACK = sarcl.Trajectory.line(start=(-500, 0, 800), velocity=(0, 50, 0), prf=100, n_pulses=5)
SCENE = sarcl.Scene.points([[0, 0, 0]]) + sarcl.shapes.plate((1, 1), material=sarcl.Material(3.0, name="<b>wax</b>"))
RAW = sarcl.echo(SCENE, CHIRP, TRACK, tolerance=1e-2)


class Cells(HTMLParser):
    """Texts of the cells of a table, and its caption."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.tags: set[str] = set()
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)

    def handle_data(self, data):
        self.texts.append(data)


def cells(value) -> dict[str, str]:
    parsed = Cells(value._repr_html_())
    assert parsed.tags == {"table", "caption", "tr", "th", "td"}  # names given by users are no markup
    assert parsed.texts[0] == f"sarcl.{type(value).__name__}" and len(parsed.texts) % 2 == 1
    return dict(zip(parsed.texts[1::2], parsed.texts[2::2], strict=True))


def test_a_notebook_shows_a_table_of_each_object():
    assert cells(TRACK)["times"] == "0 to 0.04 s, 100 Hz" and cells(TRACK)["speed"] == "50 m/s"
    assert cells(SCENE)["points"] == "1" and cells(SCENE)["facets of <b>wax</b>"] == "2"
    assert cells(RAW)["resolution in range"] == "0.2498 m" and cells(RAW)["polarization"] == "HH"
    assert cells(RAW.report)["error"].startswith("1.0e-02 asked")
    forecast = sarcl.plan(sarcl.echo, SCENE, CHIRP, TRACK, tolerance=1e-2)
    assert cells(forecast)["method"] == forecast.method


def test_print_of_a_track_is_a_few_lines():
    lines = str(TRACK).splitlines()
    assert lines[0] == "Trajectory" and 4 <= len(lines) <= 10 and "length                 2 m" in str(TRACK)
    lone = sarcl.Trajectory.circle(radius=1e3, height=1e3, arc=0.0, n_pulses=1)
    assert "length                 0 m" in str(lone) and "times" not in str(lone)


def test_echoes_and_images_have_the_properties_of_arrays():
    assert (RAW.shape, RAW.ndim, RAW.dtype, RAW.nbytes) == (RAW.samples.shape, 2, np.complex64, RAW.samples[:].nbytes)
    image = sarcl.backproject(RAW, sarcl.ImageGrid.plane(shape=(6, 8), spacing=0.2))
    assert (image.shape, image.ndim, image.dtype) == ((6, 8), 2, np.complex64)
    with pytest.raises(TypeError, match=r"samples is a PhaseHistory; give its samples \(raw\.samples\)"):
        sarcl.PhaseHistory(RAW, frequency=1e9, frequency_step=1e6, tx=RAW.tx, reference_range=1.0)
    with pytest.raises(TypeError, match=r"image data is an Image; give its pixels \(image\.data\)"):
        sarcl.Image(image, image.grid)
