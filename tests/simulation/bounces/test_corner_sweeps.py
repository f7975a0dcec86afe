"""Corner reflectors over a range of aspects: closed forms of geometrical optics, and totals of another program."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl import shapes

FREQUENCY = 9.6e9
BORESIGHT = float(np.degrees(np.arctan(np.sqrt(0.5))))
SWEEP = np.arange(-20.0, 20.25, 0.5)  # degrees about the boresight
PRINTED = (
    0.1  # dB: totals of another program, whose single and double reflections have the other sign beside triple ones
)
SWEPT = 0.5  # dB: single reflections and their interference, within 15 dB of the peak
CORNERS = {
    "dihedral": (lambda a: shapes.dihedral((a, a)), lambda a, u: shapes.dihedral_rcs((a, a), u, FREQUENCY), (0, 45)),
    "square": (
        lambda a: shapes.trihedral(a, form="square"),
        lambda a, u: shapes.trihedral_rcs(a, u, FREQUENCY, form="square"),
        (45, BORESIGHT),
    ),
    "triangular": (shapes.trihedral, lambda a, u: shapes.trihedral_rcs(a, u, FREQUENCY), (45, BORESIGHT)),
}


def db(amplitude: np.ndarray) -> np.ndarray:
    return 20 * np.log10(np.abs(amplitude))


@pytest.mark.parametrize("side", [0.5, 1.0])
@pytest.mark.parametrize("axis", ["azimuth", "elevation"])
@pytest.mark.parametrize("name", CORNERS)
def test_over_40_degrees_all_reflections_are_near_the_area_of_the_highest(name, axis, side):
    scene, closed_form, middle = CORNERS[name]
    azimuth, elevation = np.radians(
        [middle[0] + SWEEP * (axis == "azimuth"), middle[1] + SWEEP * (axis == "elevation")]
    )
    across = np.cos(elevation)
    u = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)], axis=-1)
    closed = closed_form(side, u)
    s = sarcl.rcs(scene(side), azimuth, elevation, FREQUENCY, bounces=3, polarization=("HH", "VV"))
    strong = closed > 10**-1.5 * closed.max()
    assert strong.sum() > 5
    assert np.abs(db(s[strong]) - 10 * np.log10(closed[strong, None])).max() < SWEPT


# form, side m, azimuth, elevation in degrees, HH and VV in dBsm: one, two and three reflections together
TOTALS = [
    ("square", 0.5, 45, BORESIGHT, 33.828, 33.828),
    ("square", 0.5, 45, 15, 26.876, 26.851),
    ("square", 0.5, 45, 55, 27.162, 27.152),
    ("square", 0.5, 25, BORESIGHT, 28.505, 28.502),
    ("square", 0.5, 30, 20, 26.848, 26.860),
    ("triangular", 0.5, 45, BORESIGHT, 24.305, 24.305),
    ("triangular", 0.5, 45, 15, 20.948, 20.930),
    ("triangular", 0.5, 45, 55, 21.172, 21.163),
    ("triangular", 0.5, 25, BORESIGHT, 22.309, 22.307),
    ("triangular", 0.5, 30, 20, 21.002, 21.002),
    ("square", 1.0, 45, BORESIGHT, 45.872, 45.872),
    ("triangular", 1.0, 45, BORESIGHT, 36.314, 36.314),
]


@pytest.mark.parametrize(("form", "side", "azimuth", "elevation", "hh", "vv"), TOTALS)
def test_trihedrals_have_the_printed_totals(form, side, azimuth, elevation, hh, vv):
    scene = shapes.trihedral(side, form=form)
    s = sarcl.rcs(
        scene, *np.radians([azimuth, elevation]), FREQUENCY, bounces=3, polarization=("HH", "VV"), tolerance=1e-4
    )
    assert db(s).ravel() == pytest.approx([hh, vv], abs=PRINTED)


def order_by_order(form: str, side: float, azimuth: float, elevation: float, n: int = 600) -> np.ndarray:
    """Amplitudes HH and VV, m (3, 2), of one, two and three reflections: the currents on n x n places of every plate,
    from rays that are followed back to the radar."""
    u = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    h = np.array([-np.sin(azimuth), np.cos(azimuth), 0])
    k, axes, out = 2 * np.pi * FREQUENCY / 299_792_458.0, np.eye(3), np.zeros((3, 2), complex)
    at = (np.arange(n) + 0.5) / n * side

    def is_inside(places: np.ndarray, plate: int) -> np.ndarray:
        a, b = np.delete(places, plate, axis=1).T
        return (a > 0) & (b > 0) & (a + b < side if form == "triangular" else np.maximum(a, b) < side)

    for last in range(3):
        places = np.insert(np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2), last, 0.0, axis=1)
        places = places[is_inside(places, last)]
        others = [i for i in range(3) if i != last]
        for plates in [(), *((i,) for i in others), *((j, i) for i in others for j in range(3) if j != i)]:
            ways, fields = [-u], np.stack([h, np.cross(u, h)])
            for i in plates:
                ways.append(ways[-1] * (1 - 2 * axes[i]))
                fields = -fields + 2 * fields[:, [i]] * axes[i]
            if ways[-1][last] >= 0:
                continue
            path, place, reaches = np.zeros(len(places)), places, np.ones(len(places), bool)
            for way, plate in zip(ways[:0:-1], reversed(plates), strict=True):
                length = place[:, plate] / way[plate]
                place = place - length[:, None] * way
                reaches &= (length > 0) & is_inside(place, plate)
                path += length
            wave = (reaches * np.exp(-1j * k * (path - place @ u - places @ u))).sum() * (side / n) ** 2
            current = 2 * np.cross(axes[last], np.cross(ways[-1], fields))
            out[len(plates)] += k / (2 * np.sqrt(np.pi)) * wave * (current * [h, np.cross(u, h)]).sum(axis=1)
    return out


@pytest.mark.parametrize(("form", "azimuth", "elevation"), [("triangular", 45, BORESIGHT), ("square", 40, 15)])
def test_each_order_has_the_amplitude_and_the_sign_of_its_currents(form, azimuth, elevation):
    look = np.radians([azimuth, elevation])
    expected = order_by_order(form, 0.5, *look)
    totals = [
        sarcl.rcs(
            shapes.trihedral(0.5, form=form), *look, FREQUENCY, bounces=n, polarization=("HH", "VV"), tolerance=1e-4
        ).ravel()
        for n in (1, 2, 3)
    ]
    orders = np.diff([np.zeros(2), *totals], axis=0)
    assert np.abs(orders - expected).max() < 5e-3 * np.abs(expected).max()  # outlines of beams between the places


@pytest.mark.parametrize(("side", "level"), [(0.5, -41), (1.0, -47)])
def test_cross_polarisation_of_a_trihedral_off_boresight(side, level):
    look = np.radians([25, BORESIGHT])
    s = sarcl.rcs(
        shapes.trihedral(side, form="square"),
        *look,
        FREQUENCY,
        bounces=3,
        polarization=("HH", "HV", "VH"),
        tolerance=1e-4,
    ).ravel()
    assert db(s[1] / s[0]) == pytest.approx(level, abs=0.5)  # printed as a whole number
    assert abs(s[1] - s[2]) < 1e-3 * abs(s[0])


ROLLS = [(10, 43.540, 43.603, 34.792), (22.5, 41.059, 41.143, 41.101), (45, -1.08, -1.08, 44.111)]  # degrees, dBsm


@pytest.mark.parametrize(("roll", "hh", "vv", "hv"), ROLLS)
def test_a_rolled_dihedral_has_the_printed_totals(roll, hh, vv, hv):
    look, psi = np.array([1, 0, 1]) / np.sqrt(2), np.radians(roll)
    k = np.cross(np.eye(3), look)
    turn = np.eye(3) + np.sin(psi) * k + (1 - np.cos(psi)) * k @ k
    scene = shapes.dihedral((1.0, 1.0), rotation=turn)
    s = sarcl.rcs(
        scene, 0.0, np.pi / 4, FREQUENCY, bounces=2, polarization=("HH", "VV", "HV", "VH"), tolerance=1e-4
    ).ravel()
    assert db(s) == pytest.approx([hh, vv, hv, hv], abs=0.01)
