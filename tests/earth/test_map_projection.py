"""Coordinates of maps: their reach, units and scale, and the map that a place takes."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl

pytest.importorskip("pyproj", reason="no pyproj: pip install sarcl[maps]")

from sarcl.earth.map_projection import MapProjection


def reaches(crs, longitude, latitude):
    try:
        MapProjection.of(crs).check_reach(np.array([longitude]), np.array([latitude]))
    except ValueError as exc:
        assert "does not reach" in str(exc)
        return False
    return True


@pytest.mark.parametrize(
    ("crs", "longitude", "latitude", "wanted"),
    [
        ("EPSG:27700", -1.0, 52.0, True), ("EPSG:27700", 7.5, 52.0, True),  # Britain, and 6 degrees around it
        ("EPSG:27700", 9.0, 52.0, False), ("EPSG:27700", -16.0, 52.0, False),
        ("EPSG:27700", 0.0, 43.0, False), ("EPSG:27700", 0.0, 68.0, False),
        ("EPSG:2193", 179.0, -40.0, True), ("EPSG:2193", -179.0, -40.0, True), ("EPSG:2193", 12.0, -40.0, False),
        ("EPSG:32633", 11.0, 42.0, True), ("EPSG:32633", 40.0, 42.0, False),
        ("EPSG:4326", -170.0, 89.0, True), ("EPSG:3857", 12.0, 89.0, True),
    ],
)  # fmt: skip
def test_a_map_reaches_its_area_and_six_degrees_around(crs, longitude, latitude, wanted):
    assert reaches(crs, longitude, latitude) == wanted


@pytest.mark.parametrize(
    ("longitude", "latitude", "wanted"),
    [
        (12.5, 41.9, "EPSG:32633"), (12.5, -41.9, "EPSG:32733"), (-180, 10, "EPSG:32601"), (179.9, 10, "EPSG:32660"),
        (180, 10, "EPSG:32601"), (359, 0, "EPSG:32630"), (0, 85, "EPSG:5041"), (0, -81, "EPSG:5042"),
    ],
)  # fmt: skip
def test_a_place_has_its_utm_zone_or_ups(longitude, latitude, wanted):
    assert MapProjection.at(longitude, latitude).text == wanted


def test_scales_and_units_are_those_of_the_coordinates():
    up, across = MapProjection.of(4326).scale(12.0, 60.0)
    assert up == pytest.approx(111_412, abs=30) and across == pytest.approx(55_800, abs=5)
    assert MapProjection.of("EPSG:2263").unit == "US survey foot"
    assert MapProjection.of(3857).scale(0.0, 8_399_737.9)[1] == pytest.approx(0.5, abs=2e-3)  # 60 degrees north


def test_grids_cross_the_antimeridian_in_one_piece():
    grid = sarcl.ImageGrid.plane(shape=(20, 30), spacing=10.0).on_earth(180.0, -40.0)
    projection = MapProjection.of(4326)
    x = projection.coordinates(grid.positions, 179.999)[..., 0]
    assert np.ptp(x) < 0.01 and (np.diff(x, axis=1) > 0).all()
