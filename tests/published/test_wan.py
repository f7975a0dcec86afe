"""Wan, Yue and Yang 2004: speckle (Fig 3), 16 patches of roughness and permittivity (Figs 4, 5), solids (Figs 6-8).

The paper gives neither wavelength nor resolution. Heights of 0.08 to 0.23 m need a long wave: L band, facets of
three wavelengths, resolution cells of a hundred facets.
"""

from __future__ import annotations

import numpy as np
import pytest
from helpers.published_cases import Radar, expected, ground, inside_box, inside_frustum, looks, misfit, speckle
from scipy import stats

from sarcl import shapes
from sarcl.reference import facet
from sarcl.scene.material import Material

# patches in the order of rising values, as Fig 4 numbers them row by row from above; the 14th has the middle value
ORDER = (1, 2, 3, 4, 8, 12, 16, 15, 14, 13, 9, 5, 6, 7, 11, 10)
RISING = np.argsort(ORDER)  # place of patches 1 to 16 in that order
SIDE = 0.75  # of the squares that two facets make, m
LONG = {"look": np.radians(30), "bandwidth": 50e6, "turn": 0.05, "center": 1.27e9}


def values(middle, step):
    """Of patches 1 to 16."""
    return middle + step * (RISING - ORDER.index(14))


def field(radar, size, roughness, permittivity, seed):
    """A terrain of 4 x 4 patches of `size` resolution cells a side, realized, and the patch of each of its squares."""
    cells = [round(size * n / SIDE) for n in radar.null]
    patch = np.arange(16).reshape(4, 4)[::-1]  # rows from below
    fine = np.repeat(np.repeat(patch, cells[0], axis=0), cells[1], axis=1)
    points = np.pad(roughness[fine], (0, 1), mode="edge")
    ends = [(-2 * size * n, 2 * size * n) for n in radar.null]
    scene = ground(
        *ends, fine.shape, material=fine, materials=[Material(eps_r=e) for e in permittivity], point_roughness=points
    )
    return scene.realized(seed), fine


def brightness(radar, size, scene, seed):
    """sigma0 of each patch (16,) in the image, and its standard error, relative."""
    grid = radar.grid((4 * size, 4 * size), center=(radar.null[1] / 2, radar.null[0] / 2, 0))
    pixels = radar.focus(radar.echo(scene, shadows=False, seed=seed), grid)
    power = np.abs(pixels[::-1].reshape(4, size, 4, size)[:, 2:-2, :, 2:-2]) ** 2 / np.prod(radar.null)
    power = power.transpose(0, 2, 1, 3).reshape(16, -1)
    return power.mean(axis=1), power.std(axis=1) / power.mean(axis=1) / np.sqrt(power.shape[1])


def surfaces_power(radar, scene, fine, permittivity):
    """sigma0 of each patch (16,) as physical optics has it for this very surface, without echo or image, and its error.

    Amplitudes of cells of two facets add with those of the cells around; others are too far off in height to keep a
    phase. Without their neighbours facets would have edges, and smooth ground be up to 9 dB brighter.
    """
    eps = np.repeat(permittivity[fine.ravel()], 2).astype(complex)
    amplitude = facet.facet_amplitude(scene.triangles, eps, radar.center, radar.up, radar.up)[:, 0, 0]
    phase = 4 * np.pi * radar.center / 299792458.0 * (scene.triangles.mean(axis=1) @ radar.up)
    cell = (amplitude * np.exp(1j * phase)).reshape(*fine.shape, 2).sum(axis=-1)
    near = sum(np.roll(cell, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1))
    product = (cell * near.conj()).real / np.prod([np.ptp(scene.triangles[..., axis]) for axis in (0, 1)]) * fine.size
    rows, columns = fine.shape[0] // 4, fine.shape[1] // 4
    # rows from below, patches from above; strips of some rows are all but independent
    strips = product.reshape(4, rows, 4, columns)[::-1, : rows // 8 * 8].reshape(4, 8, -1, 4, columns).mean(axis=(2, 4))
    mean = strips.mean(axis=1).ravel()
    return mean, strips.std(axis=1, ddof=1).ravel() / mean / np.sqrt(8)


def fig_5(size, roughness, permittivity, seeds):
    """Means over seeds of what the image has and of what the surfaces send back, and the error of their ratio."""
    radar = Radar(**LONG, n_pulses=int(5.2 * size))
    found = []
    for seed in range(seeds):
        scene, fine = field(radar, size, roughness, permittivity, seed)
        found.append([*brightness(radar, size, scene, seed), *surfaces_power(radar, scene, fine, permittivity)])
    got, error, wanted, its_error = np.mean(found, axis=0)
    return got, wanted, np.hypot(error, its_error) / np.sqrt(seeds)


SIZES = [pytest.param(14, 1, id="small"), pytest.param(24, 1, id="large", marks=pytest.mark.slow)]


@pytest.mark.slow
@pytest.mark.parametrize("size, seeds", SIZES)
def test_fig_5a_roughness_brightens_as_the_slopes_allow(size, seeds):
    got, wanted, error = fig_5(size, values(0.16, 0.01), np.full(16, 3.0), seeds)
    assert np.abs((got / wanted - 1) / error).max() < 4
    assert (got / wanted).mean() == pytest.approx(1, abs=4 * np.linalg.norm(error) / 16)
    assert stats.spearmanr(got, RISING).statistic > 0.9
    # slopes of rms sqrt(2) sigma/side: 0.15 to 0.43, of which 0.58 = tan 30 deg is far out, then near
    assert 10 < 10 * np.log10(got[9] / got[0]) < 18


@pytest.mark.parametrize("size, seeds", SIZES)
def test_fig_5b_permittivity_brightens_as_fresnel_says(size, seeds):
    # the paper says that it falls: no |R| does, above 1
    permittivity = values(3.0, 0.2)
    got, wanted, error = fig_5(size, np.full(16, 0.16), permittivity, seeds)
    assert np.abs((got / wanted - 1) / error).max() < 4
    assert stats.spearmanr(got, RISING).statistic > 0.9
    # what shines faces the radar, hence |R(0)|^2: 1.4 to 4.4 are 12.5 dB apart
    reflected = ((np.sqrt(permittivity) - 1) / (np.sqrt(permittivity) + 1)) ** 2
    slope, _, r, _, slope_error = stats.linregress(10 * np.log10(reflected), 10 * np.log10(got))
    assert slope == pytest.approx(1, abs=max(0.05, 3 * slope_error)) and r > 0.98


@pytest.mark.slow
def test_fig_3_amplitudes_are_rayleigh_where_enough_facets_share_a_cell():
    radar, size = Radar(**LONG, n_pulses=52), 40
    ends = [(-size * n / 2, size * n / 2) for n in radar.null]
    stone = {"material": Material(eps_r=3.0), "point_roughness": 0.15}
    pixels = []
    for side in (0.5, 0.75):  # 226 and 100 facets a cell
        scene = ground(*ends, [round(size * n / side) for n in radar.null], **stone)
        pixels.append(radar.focus(radar.echo(scene, shadows=False, seed=1), radar.grid((size, size)))[2:-2, 2:-2])
    many, few = (speckle(p) for p in pixels)
    assert pixels[0].size >= 1000
    assert many[0] > 0.01 and many[1] > 0.01 and many[2] == pytest.approx(1, abs=0.15)
    # with a hundred, of which few face the radar, the phase is still uniform
    assert few[0] < 1e-3 and few[1] > 0.01 and few[2] > 1.2


@pytest.mark.slow
@pytest.mark.parametrize("n", [12])
def test_figs_6_to_8_a_frustum_a_cuboid_and_a_cylinder_on_rough_ground(n):
    # foreshortening in front, shadow behind: all where lines of sight put them
    stone = {"material": Material(eps_r=3.0, diagram="cos2")}
    radar = Radar(look=np.radians(45), bandwidth=100e6, turn=0.014, n_pulses=64)
    plain = ground((-34, 34), (-50, 45), **stone)
    foot = shapes.frustum(18, 12, 4, sections=120, **stone).on(plain, 0, 2)
    middle = shapes.box((14, 14, 6), **stone).on(foot, 0, 2)
    top = shapes.cylinder(5, 6, **stone).on(middle, 0, 2)
    hiding = [
        inside_frustum(0, 2, 0, 18, 12, 4),
        inside_box(0, 2, 4, (14, 14, 6)),
        inside_frustum(0, 2, 10, 5, 5, 6),
    ]
    grid = radar.grid((78, 76), pixels=2)
    scene = plain + foot + middle + top
    power = looks(radar, scene, grid, n)[0]
    wanted = expected(radar, scene, hiding, grid, "hamming")
    off, error, mean = misfit(power, wanted, n)
    assert off == pytest.approx(1, abs=4 * error) and abs(mean) < 4
    dark = wanted < 1e-2 * np.median(wanted)
    assert dark.sum() > 100 and power[dark].mean() < 1.5 * wanted[dark].mean()
    for shift in ((2, 0), (0, 2)) if n > 2 else ():  # moved by a null it would not fit; two looks are too few
        assert misfit(power, np.roll(wanted, shift, (0, 1)), n)[0] > 1 + 3 * error
