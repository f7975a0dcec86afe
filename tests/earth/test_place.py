"""Places on the Earth: local axes, heights above a geoid, and what is no place."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.earth.place import Place


def test_local_axes_are_east_north_and_up():
    place = Place(10.0, 45.0, 120.0)
    steps = place.positions(np.array([[0.0, 0, 0], [100, 0, 0], [0, 100, 0], [0, 0, 100]]))
    longitude, latitude, height = sarcl.wgs84.geodetic(steps)
    assert [longitude[0], latitude[0], height[0]] == pytest.approx([10, 45, 120], abs=1e-8)
    assert longitude[1] > 10 and abs(latitude[1] - 45) < 1e-6
    assert latitude[2] > 45 and longitude[2] == pytest.approx(10, abs=1e-12)
    assert height[3] == pytest.approx(220, abs=1e-8) and longitude[3] == pytest.approx(10, abs=1e-12)
    assert np.allclose(np.linalg.norm(steps[1:] - steps[0], axis=1), 100)


@pytest.mark.parametrize("geoid", [48.0, lambda longitude, latitude: longitude + latitude])
def test_heights_above_a_geoid_gain_its_undulation(geoid):
    place = Place.above(10.0, 38.0, 120.0, heights="EGM96", geoid=geoid)
    assert place.height == 168.0
    assert Place.above(10.0, 38.0, 120.0) == Place(10.0, 38.0, 120.0)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: Place(10, 90.5), "latitude is 90.5; give degrees from -90 to 90"),
        (lambda: Place(400, 0), "longitude is 400; give degrees"),
        (lambda: Place(0, 0, np.nan), "height"),
        (lambda: Place.above(0, 0, 1, heights="EGM96"), "give the undulation as geoid"),
        (lambda: Place.above(0, 0, 1, heights="WGS84 ellipsoid", geoid=3), "count the undulation twice"),
        (lambda: Place.above(0, 0, 1, heights=""), "heights is ''"),
    ],
)
def test_what_is_no_place_is_refused(call, said):
    with pytest.raises(ValueError, match=said):
        call()


def test_scenes_and_grids_go_to_the_earth_together():
    ground = sarcl.Scene.from_heights([-9, 9], [-9, 9], np.ones((2, 2)), point_roughness=0.1)
    scene = (ground + sarcl.Scene.points([[1, 2, 3]])).on_earth(10.0, 45.0, 120.0)
    place = Place(10.0, 45.0, 120.0)
    assert np.allclose(scene.positions, place.positions([[1, 2, 3]]), atol=1e-8, rtol=0)
    normals = np.cross(scene.triangles[:, 1] - scene.triangles[:, 0], scene.triangles[:, 2] - scene.triangles[:, 0])
    assert ((normals @ place.axes[2]) > 0).all() and scene.heights is None
    moved = scene.realized(3).triangles - scene.triangles
    assert np.abs(moved - (moved @ place.axes[2])[..., None] * place.axes[2]).max() < 1e-8  # corners move up and down
    plane = sarcl.ImageGrid.plane(center=(1, 2, 3), shape=(5, 7), spacing=(2, 3), normal=(0, 1, 1))
    for grid in (plane, sarcl.ImageGrid.points(plane.positions)):
        assert np.abs(grid.on_earth(10.0, 45.0, 120.0).positions - place.positions(plane.positions)).max() < 1e-8
