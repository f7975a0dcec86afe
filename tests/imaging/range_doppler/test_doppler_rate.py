"""The Doppler rate of range_doppler: from the geometry, from the data by map drift, or given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from imaging.test_range_doppler import SPEED, noise, points, seen_from_orbit

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT

WAVE = SPEED_OF_LIGHT / 9.6e9
STRIP = {"azimuth_beam": 0.015, "ranges": (3985, 4015)}
SCATTER = np.random.default_rng(0).uniform(-1, 1, (20, 2)) * [12.0, 60.0]


def strip(faster=1.0, places=SCATTER, **track):
    """Echoes of points at 4 km, whose track is said to be slower than it was by the factor `faster`."""
    raw = points([(x, y, 0) for x, y in places], reference=4e3, **({"aperture": 400.0, "n": 500} | track))
    slower = raw.tx / [1, faster, 1]
    return replace(raw, tx=slower, rx=slower)


def rates(image):
    """Doppler rate used and that of the geometry, Hz/s."""
    plan = image.report.plan
    return [float(plan[name].split()[0]) for name in ("Doppler rate", "Doppler rate of the geometry") if name in plan]


@pytest.mark.parametrize("faster", [1.0, 1.01, 0.97])
def test_the_rate_of_a_strip_map_is_told_by_the_data(faster):
    raw = strip(faster)
    image = sarcl.range_doppler(raw, doppler_rate="data", **STRIP)
    used, geometry = rates(image)
    true = -2 * SPEED**2 / (WAVE * 4e3)
    print(used / true - 1, geometry / true - 1)
    assert used == pytest.approx(true, rel=5e-4)  # 0.02 rad of quadratic phase at the ends of the beam
    assert geometry == pytest.approx(true / faster**2, rel=2e-4)
    assert float(image.report.plan["effective velocity"].split()[0]) == pytest.approx(SPEED, rel=2.5e-4)


def test_the_image_with_the_rate_of_the_data_is_as_sharp_as_with_the_true_track():
    lone, sharpness = np.array([[0.0, 0.0]]), {}
    for name, raw, rate in (
        ("true", strip(places=lone), "geometry"), ("wrong", strip(1.03, lone), "geometry"),
        ("data", strip(1.03, lone), "data"),
    ):  # fmt: skip
        image = sarcl.range_doppler(raw, doppler_rate=rate, spacing=(0.002, None), **STRIP)
        power = np.abs(image.data) ** 2
        sharpness[name] = (power**2).sum() / power.sum() ** 2
    assert sharpness["wrong"] < 0.7 * sharpness["true"]
    assert sharpness["data"] == pytest.approx(sharpness["true"], rel=0.02)


@pytest.mark.parametrize("squint", [0.0, 0.15])
def test_without_a_beam_the_looks_are_halves_of_the_rows(squint):
    places = SCATTER * [1, 0.25]
    raw = strip(1.01, places, aperture=90.0, n=300, squint=squint)
    raw = replace(raw, reference_range=np.linalg.norm(raw.tx, axis=1)) if squint else raw
    samples = points([(x, y, 0) for x, y in places], reference=4e3, aperture=90.0, n=300, squint=squint).samples
    if squint:  # echoes of the true track about the reference ranges of the wrong one
        f = raw.frequency[0] + np.arange(raw.n_samples) * raw.frequency_step[0]
        moved = raw.reference_range - 4e3
        raw = replace(raw, samples=samples * np.exp(4j * np.pi / SPEED_OF_LIGHT * np.outer(moved, f)))
    used, geometry = rates(sarcl.range_doppler(raw, doppler_rate="data", doppler="data"))
    true = geometry * 1.01**2 if not squint else None
    middle = np.linalg.norm(points([(0, 0, 0)], aperture=90.0, n=300, squint=squint).tx.mean(axis=0))
    sine = np.sin(np.arctan(0.7 * np.tan(squint)))
    true = -2 * SPEED**2 / (WAVE * middle) * (1 - sine**2)
    print(used / true - 1, geometry / true - 1)
    assert abs(used / true - 1) < 0.1 * abs(geometry / true - 1)


def test_a_rate_that_is_given_is_used_and_checked():
    raw = noise()
    middle = rates(sarcl.range_doppler(raw))[0]
    image = sarcl.range_doppler(raw, doppler_rate=1.02 * middle, tolerance=1e-3, check=True)
    assert rates(image) == pytest.approx([1.02 * middle, middle], rel=1e-5)
    assert image.report.measured_error <= image.report.predicted_error <= 1e-3
    same = sarcl.range_doppler(raw, doppler_rate=middle, tolerance=1e-3)
    assert np.linalg.norm(same.data - sarcl.range_doppler(raw, tolerance=1e-3).data) <= 2e-3 * np.linalg.norm(same.data)


@pytest.mark.parametrize(
    ("rate", "said"),
    [
        ("track", "choose 'geometry', 'data' or a number in Hz/s"),
        (160.0, "give a negative rate"),
        (0.0, "negative rate"),
        (np.nan, "doppler_rate"),
        ("data", "noise or ground without contrast"),
    ],
)  # fmt: skip
def test_rates_that_cannot_be_are_refused(rate, said):
    with pytest.raises(ValueError, match=said):
        sarcl.range_doppler(noise(), doppler_rate=rate)


def test_centroid_and_rate_of_an_orbit_are_those_of_its_geometry():
    """Not those that the satellite's own speed would give: it is 6 % above the effective velocity."""
    raw, place = seen_from_orbit(n=300, width=300.0)
    plan = sarcl.range_doppler(raw, side="right", heights=200.0, doppler="data").report.plan
    path = (np.linalg.norm(raw.tx - place, axis=1) + np.linalg.norm(raw.rx - place, axis=1)) / 2
    first, second = (np.polyfit(raw.time - raw.time.mean(), path, 3)[-1 - k] * k for k in (1, 2))
    hertz = -2 * float(raw.center_frequency[0]) / SPEED_OF_LIGHT
    assert float(plan["Doppler centroid"].split()[0]) == pytest.approx(hertz * first, abs=1.0)
    assert float(plan["Doppler rate"].split()[0]) == pytest.approx(hertz * second, rel=2e-3)
