"""rcs(edges=True) of a plate beside its full wave; reciprocity."""

import numpy as np
import pytest

import sarcl
from sarcl import Scene, shapes

# dB m^2 at 4, 8 ... 60 degrees from the normal, across the longer side: fullwave_echo of a plate 5 mm thick at
# 2.5475 GHz, 26 cells per wavelength
FULL_WAVE = {
    "HH": [0.9, -4.5, -20.8, -11.4, -11.0, -18.0, -19.3, -14.7, -15.7, -19.8, -20.7, -18.9, -18.8, -19.0, -17.9],
    "VV": [0.7, -5.0, -26.2, -12.1, -11.9, -16.5, -15.9, -15.4, -20.3, -34.2, -21.6, -18.0, -15.9, -14.3, -13.5],
}
BOX = Scene.facets(shapes.box((0.5, 0.4, 0.3), rotation=(0.2, 0.5, -0.4)).triangles, two_sided=False)
LEANING = Scene.facets(np.array([[[0, 0, 0], [1, 0.1, 0], [0.8, 0.6, 0]], [[0, 0, 0], [0.8, 0.6, 0], [0.1, 0.5, 0]]]))
F = 3e9


@pytest.mark.parametrize(("polarization", "gate"), [("HH", 1.6), ("VV", 1.7)])
def test_a_plate_beside_its_full_wave(polarization, gate):
    plate, wanted = shapes.plate((10.5 * 0.0254, 6 * 0.0254)), np.array(FULL_WAVE[polarization])
    elevation = np.pi / 2 - np.radians(np.arange(4, 61, 4))
    got = sarcl.rcs(plate, 0.0, elevation, 2.5475e9, edges=True, polarization=polarization, tolerance=1e-3)
    near = wanted > wanted.max() - 25
    assert np.sqrt(np.mean((20 * np.log10(np.abs(got)).ravel() - wanted)[near] ** 2)) < gate


@pytest.mark.parametrize("scene", [BOX, LEANING], ids=["box", "leaning"])
def test_waves_from_border_to_border_are_reciprocal(scene):
    """Single edges are not: what both ways of two antennas differ by comes from these alone."""
    from sarcl.reference.edges import border_echo
    from sarcl.scene.facing_borders import facing_borders
    from sarcl.scene.wedges import wedges

    looks = [np.array([0.3, 0.4, 0.8]) * 1e6, np.array([-0.2, 0.5, 0.7]) * 1e6]
    pairs = list(facing_borders(scene.triangles, wedges(scene.triangles, scene.two_sided, 0.35)))
    forth, back = (
        sum(border_echo(ends, frame, np.array([F]), antennas, 1e6) for ends, frame in pairs)
        for antennas in (looks, looks[::-1])
    )
    assert np.abs(forth - back.swapaxes(1, 2)).max() < 1e-6 * np.abs(forth).max()
