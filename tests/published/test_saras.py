"""SARAS (Franceschetti et al. 1992), Figs 10 to 17, echoed and focused: statistics, materials, layover, shadows.

The paper gives few parameters: these keep its number of facets per resolution cell, with facets of several wavelengths.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.published_cases import Radar, expected, ground, inside_box, inside_frustum, looks, misfit, speckle
from scipy import stats

import sarcl
from sarcl import shapes
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.scattering.physical_optics import fresnel
from sarcl.scattering.random_surface import cell_edge, pieces_of
from sarcl.scene.material import Material

EARTH = {"eps_r": 4.0, "conductivity": 1e-3}
ROUGH, SMOOTH = Material(**EARTH, diagram="cos2"), Material(**EARTH)

FLAT = Radar(look=np.radians(35), bandwidth=300e6, turn=0.05, n_pulses=52)
NULLS = 40  # cells a side of an image, one null apart
# facets per resolution cell along y (azimuth) and x (range), material, sigma of the heights
CASES = {
    "a": ((4, 4), ROUGH, 0.0312),
    "b": ((4, 4), ROUGH, 0.0),
    "c": ((16, 4), SMOOTH, 0.0312),
    "d": ((4, 4), SMOOTH, 0.0),
}


def fig_12(case, seed=1, cells=None):
    a_null, material, sigma = CASES[case]
    cells = [NULLS * n for n in cells or a_null]
    y, x = ((-NULLS * n / 2, NULLS * n / 2) for n in FLAT.null)
    scene = ground(y, x, cells, material=material, point_roughness=sigma)
    return FLAT.focus(FLAT.echo(scene, seed=seed), FLAT.grid((NULLS, NULLS)))[2:-2, 2:-2]


@pytest.mark.parametrize("case", ["a", "b"])
def test_fig_12_facets_that_are_rough_make_rayleigh_speckle(case):
    rayleigh, uniform, contrast = speckle(fig_12(case))
    assert rayleigh > 0.01 and uniform > 0.01
    assert contrast == pytest.approx(1, abs=0.12)  # 1296 pixels: a standard error of 0.055


@pytest.mark.slow
def test_fig_12_smooth_facets_on_a_rough_profile_do_not():
    # smooth facets shine where they happen to face the radar: few a cell, and the brightest cells stand out
    for cells in ((16, 4), (4, 4)):
        rayleigh, uniform, contrast = speckle(fig_12("c", cells=cells))
        assert rayleigh < 1e-9 and contrast > 1.7
        assert uniform > 0.01  # their places stay random
    # sixteen in range are 1.7 wavelengths long: their lobes are so wide, and slopes so steep, that many add up
    rayleigh, uniform, contrast = speckle(fig_12("c", cells=(4, 16)))
    assert rayleigh > 0.01 and uniform > 0.01 and contrast < 1.2


@pytest.mark.slow
def test_fig_12_without_statistics_nothing_is_random():
    once, again, rough = fig_12("d", seed=1), fig_12("d", seed=2), fig_12("b")
    assert np.array_equal(once, again)
    assert speckle(once)[0] < 1e-9
    # a mirror: only its edges are seen from the side
    assert (np.abs(once) ** 2).mean() < 1e-6 * (np.abs(rough) ** 2).mean()


FIELD, MARGIN = (144, 216), 3  # resolution cells; those so near to a neighbour are left out
WIDE = Radar(look=FLAT.look, bandwidth=FLAT.bandwidth, turn=FLAT.turn, n_pulses=192)


def patches():
    """22 patches: the number of every resolution cell's, from the lower left one, and their materials' (eps_r, S/m)."""
    rows = [first + np.arange(FIELD[1]) * n // FIELD[1] for first, n in ((0, 5), (5, 6), (11, 5), (16, 6))]
    i = np.arange(22)  # mixed, so that neighbours differ; number 11 is next to vacuum
    electric = np.linspace(1, 40, 22)[(5 * i + 11) % 22], np.geomspace(1e-4, 1, 22)[(7 * i + 11) % 22]
    return np.repeat(rows, FIELD[0] // 4, axis=0), list(zip(*electric, strict=True))


def inner(number, i):
    """Cells of a patch well away from its border."""
    mask = np.pad(number == i, MARGIN)
    shifts = [(s, a) for s in (-MARGIN, MARGIN) for a in (0, 1)]
    return np.all([np.roll(mask, *shift) for shift in shifts], axis=0)[MARGIN:-MARGIN, MARGIN:-MARGIN]


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_fig_12_of_22_patches(case):
    number, electric = patches()
    (along_y, along_x), kind, sigma = CASES[case]
    fine = np.repeat(np.repeat(number, along_y, axis=0), along_x, axis=1)
    y, x = ((-m * n / 2, m * n / 2) for m, n in zip(FIELD, WIDE.null, strict=True))
    materials = [Material(eps_r=e, conductivity=s, diagram=kind.diagram) for e, s in electric]
    scene = ground(y, x, fine.shape, material=fine, materials=materials, point_roughness=sigma).realized(1)
    # pixels are the middles of cells
    grid = WIDE.grid(FIELD, center=(WIDE.null[1] / 2, WIDE.null[0] / 2, 0))
    raw = WIDE.echo(scene, seed=1)
    sharp, clean = WIDE.focus(raw, grid), WIDE.focus(raw, grid, window="hamming")
    masks = [inner(number, i) for i in range(22)]
    n = np.array([mask.sum() for mask in masks])
    power = np.array([(np.abs(clean[mask]) ** 2).mean() for mask in masks])
    rayleigh, uniform, contrast = speckle(sharp[masks[0]])
    assert n[0] >= 1000
    reflected = np.abs([fresnel(1.0, m.permittivity(WIDE.center))[0] for m in materials]) ** 2
    if case in "ab":
        assert rayleigh > 0.01 and uniform > 0.01 and contrast == pytest.approx(1, abs=0.15)
        # the power of the facets of a patch over its cells, which Hamming's window makes 1.36 times longer
        cell = np.bincount(number.ravel())
        wanted = np.bincount(scene.material, WIDE.powers(scene)) / cell * 1.363**2
        bright = np.arange(22) != 11
        assert np.abs(power / wanted - 1)[bright].max() < 4 * 1.695 / np.sqrt(n.min())
        assert (power / wanted)[bright].mean() == pytest.approx(1, abs=0.03)
        assert power[11] < 1e-3 * np.median(power)
    elif case == "c":
        assert rayleigh < 1e-9 and uniform > 0.01 and contrast > 1.7
        assert stats.spearmanr(power, reflected).statistic > 0.9
    else:
        assert rayleigh < 1e-9
        lambert = WIDE.powers(ground(y, x, material=ROUGH)).sum() / number.size
        assert power.max() < 3e-5 * lambert  # Hamming's lobes of the edges between patches


# Relief is larger here: what matters is how many resolution cells a shape covers
RELIEF = Radar(look=np.radians(50), bandwidth=100e6, turn=0.014, n_pulses=64)
FINE = Radar(look=np.radians(50), bandwidth=150e6, turn=0.02, n_pulses=100)
STONE = {"material": ROUGH}
COTANGENT, TANGENT = 1 / np.tan(RELIEF.look), np.tan(RELIEF.look)


def decibel(x):
    return 10 * np.log10(x)


@pytest.fixture(scope="module")
def parallelepiped():
    """Fig 13: (raw, half depth, half width, height) of one on flat rough ground; 14 m are 11 cells in range."""
    scene = ground((-40, 40), (-45, 45), **STONE) + shapes.box((14, 36, 14), **STONE)
    return FINE.echo(scene, tolerance=1e-3, seed=1), 7, 18, 14


def test_fig_13_a_shadow_holds_no_speckle(parallelepiped):
    # a Taylor window of -90 dB adds -74 dB from the ground around: echo and focusing must add less
    raw, depth, width, height = parallelepiped
    grid = FINE.grid((140, 130), pixels=2)
    power = np.abs(FINE.focus(raw, grid, tolerance=1e-3, window=("taylor", 90, 16))) ** 2
    y, x = np.abs(grid.positions[..., 1]), grid.positions[..., 0]
    # edges along the track move with the antenna, so amplitudes of facets there change, and their echoes spread: four
    # nulls inside, lit parts that are exact at every pulse leave -51.4 dB too
    inside = 8 * FINE.null[0], 4 * FINE.null[1]
    dark = (y < width - inside[0]) & (x > depth - height * COTANGENT + inside[1])
    dark &= x < depth + height * TANGENT - inside[1]
    lit = power[(x > depth + height * TANGENT + inside[1]) & (x < 42)].mean()
    assert dark.sum() > 1000
    assert decibel(power[dark].max() / lit) < -60 and decibel(power[dark].mean() / lit) < -70


@pytest.fixture(scope="module")
def moving_shadow():
    """Power in a shadow whose edges move, of all and without the facets on its edges, dB of the ground beside it.

    In a wide aperture the shadow moves by half a metre along the track: amplitudes of facets on its edges, roots of lit
    shares, change from pulse to pulse, and their echoes spread.
    """
    radar = Radar(look=np.radians(50), bandwidth=300e6, turn=0.05, n_pulses=192)
    box = shapes.box((8, 12, 6), **STONE)
    scene = ground((-24, 24), (-24, 30), **STONE) + box
    raw = radar.echo(scene, tolerance=1e-4, seed=3)
    others = raw.samples - edges_of_a_shadow(radar, scene, box, raw, seed=3)
    grid = radar.grid((200, 240), pixels=2)
    y, x = np.abs(grid.positions[..., 1]), grid.positions[..., 0]
    dark = (y < 3.5) & (x > 4 - 6 * COTANGENT + 3.5) & (x < 4 + 6 * TANGENT - 3.5)
    both, rest = (
        np.abs(radar.focus(replace(raw, samples=samples), grid, tolerance=1e-4, window=("taylor", 90, 16))) ** 2
        for samples in (raw.samples, others)
    )
    lit = both[(y < 16) & (x > 16) & (x < 22)].mean()
    return decibel(both[dark].mean() / lit), decibel(rest[dark].mean() / lit)


@pytest.mark.slow
@pytest.mark.xfail(strict=True, reason="-57.4 dB: the facets on the edges, summed one by one, leave -57.6 dB")
def test_fig_13_a_shadow_stays_dark_where_its_edges_move(moving_shadow):
    assert moving_shadow[0] < -60


@pytest.mark.slow
def test_fig_13_echo_and_focusing_add_little_to_a_shadow_whose_edges_move(moving_shadow):
    # shares that stepped from block to block of pulses would leave -45 dB
    assert moving_shadow[0] < -57 and moving_shadow[1] < -70


def edges_of_a_shadow(radar, scene, box, raw, seed):
    """Echo of the cells of flat ground that are partly lit at some pulse, without the library's sums (n_pulses, n)."""
    wave = sarcl.Waveform.chirp(center=radar.center, bandwidth=radar.bandwidth, duration=1e-6)
    pieces = pieces_of(scene, cell_edge(wave), np.inf, seed)
    places = pieces.scene.triangles.mean(axis=1)
    near = np.flatnonzero((np.abs(places[:, 1]) < 8) & (np.abs(places[:, 0] - 4) < 10) & (places[:, 2] == 0))
    track = sarcl.Trajectory(np.arange(len(raw.tx)) / 100.0, raw.tx)
    share = sarcl.illumination.facet_shares(pieces.scene.part(near) + box, track)[:, : len(near)]
    partly = ((share > 0) & (share < 1)).any(axis=0)
    which, share = near[partly], share[:, partly]
    amplitude = np.sqrt(radar.powers(pieces.scene)[which]) * pieces.random[which]
    frequency, step = float(np.ravel(raw.frequency)[0]), float(np.ravel(raw.frequency_step)[0])
    out = np.zeros(raw.samples.shape, np.complex64)
    for pulse, antenna in enumerate(raw.tx):
        paths = 2 * (np.linalg.norm(places[which] - antenna, axis=1) - raw.reference_range[pulse])
        cycles = np.outer(frequency + step * np.arange(raw.n_samples), paths / SPEED_OF_LIGHT) % 1
        out[pulse] = np.exp(-2j * np.pi * cycles) @ (amplitude * np.sqrt(share[pulse]))
    return out


def edges_of(profile, at, level):
    """Where a profile (n,) falls below and rises above `level`: places between samples."""
    below = profile < level
    i = np.flatnonzero(below[1:] != below[:-1])
    return at[i] + (at[i + 1] - at[i]) * (level - profile[i]) / (profile[i + 1] - profile[i])


def test_fig_13_layover_and_shadow_end_where_they_should(parallelepiped):
    raw, depth, width, height = parallelepiped
    # the roof's rear edge, and the end of its shadow: on the ground, and along slant range
    wanted = np.array([depth - height * COTANGENT, depth + height * TANGENT])
    for plane in ("ground", "slant"):
        turned = {} if plane == "ground" else {"normal": (FINE.up[2], 0, -FINE.up[0]), "x_axis": -FINE.up}
        spacing = [n / 4 for n in FINE.null]
        spacing[1] *= np.sin(FINE.look) if plane == "slant" else 1
        grid = sarcl.ImageGrid.plane(shape=(240, 240), spacing=spacing, **turned)
        power = np.abs(FINE.focus(raw, grid, window="hamming")) ** 2
        beside = np.abs(grid.positions[:, 0, 1])
        profile = power[beside < width - 4].mean(axis=0)
        at = (np.arange(240) - 120) * spacing[1]
        lit = power[:, at > wanted[1] + 4].mean()
        # both neighbours are at least as bright as the ground; half of it lies within half a cell of the edge
        first, last = edges_of(profile, at, lit / 2)[[0, -1]]
        scale = 1.0 if plane == "ground" else np.sin(FINE.look)
        assert [first, last] == pytest.approx(wanted * scale, abs=0.5 * FINE.null[1] * scale), plane
        length = height / np.cos(FINE.look) if plane == "slant" else height * (COTANGENT + TANGENT)
        assert last - first == pytest.approx(length, abs=0.7 * FINE.null[1] * scale)
        if plane == "ground":  # layover begins where the roof's front edge is seen, and is brighter than the ground
            front = -depth - height * COTANGENT
            over = profile[(at > front + 2) & (at < -depth - 2)].mean()
            before = profile[(at > front - 15) & (at < front - 2)].mean()
            assert over > 2.5 * before
            rise = edges_of(profile[at < front + 3], at[at < front + 3], (before + over) / 2)
            assert rise[-1] == pytest.approx(front, abs=FINE.null[1])


def solids():
    """Scenes of Figs 10 and 17 and what in them casts shadows."""
    plain = ground((-34, 34), (-55, 50), **STONE)
    cone = shapes.cone(12, 12 * TANGENT, sections=120, **STONE)
    tower = shapes.cylinder(12, 8, sections=120, **STONE).on(plain, -12, -12)
    top = shapes.box((10, 12, 12), **STONE).on(tower, -12, -12)
    beside = shapes.cone(12, 16, sections=120, **STONE).on(plain, 10, 16)
    return {
        "fig 10": (plain + cone, [inside_frustum(0, 0, 0, 12, 0, 12 * TANGENT)]),
        "fig 17": (
            plain + tower + top + beside,
            [
                inside_frustum(-12, -12, 0, 12, 12, 8),
                inside_box(-12, -12, 8, (10, 12, 12)),
                inside_frustum(10, 16, 0, 12, 0, 16),
            ],
        ),
    }


GRID = RELIEF.grid((80, 90), pixels=2)


@pytest.mark.slow
@pytest.mark.parametrize("n", [12])
def test_fig_17_everything_is_where_it_should_be(n):
    scene, hiding = solids()["fig 17"]
    power, wanted = looks(RELIEF, scene, GRID, n)[0], expected(RELIEF, scene, hiding, GRID, "hamming")
    off, error, mean = misfit(power, wanted, n)
    assert off == pytest.approx(1, abs=4 * error) and abs(mean) < 4
    dark = wanted < 1e-2 * np.median(wanted)
    assert dark.sum() > 900 and power[dark].mean() < 1.5 * wanted[dark].mean()
    # moved by a null it would not fit
    for shift in ((2, 0), (0, 2)):
        assert misfit(power, np.roll(wanted, shift, (0, 1)), n)[0] > 1 + 3 * error


@pytest.mark.slow
@pytest.mark.parametrize("n", [12])
def test_figs_10_and_14_to_16_a_cone_in_three_polarisations(n):
    scene, hiding = solids()["fig 10"]
    power = looks(RELIEF, scene, GRID, n, ("HH", "VV", "HV"))
    wanted = [expected(RELIEF, scene, hiding, GRID, "hamming", pair) for pair in ((0, 0), (1, 1), (0, 1))]
    for got, exact in zip(power, wanted, strict=True):
        off, error, mean = misfit(got, exact, n)
        assert off == pytest.approx(1, abs=4 * error) and abs(mean) < 4
    # along the cone's middle its normal points to the radar: HH and VV are the brightest there, HV has nothing
    y = GRID.positions[:, 0, 1]
    middle, side = np.abs(y) < 0.5, (np.abs(y) > 5) & (np.abs(y) < 9)
    bright = [p[middle].mean(axis=0).max() / p[side].mean(axis=0).max() for p in power]
    assert bright[0] > 2 and bright[1] > 2 and bright[2] < 0.3
    # flat ground gives no HV
    flat = RELIEF.echo(ground((-34, 34), (-55, 50), **STONE), polarization=("HH", "VV", "HV")).samples
    hh, vv, hv = (np.linalg.norm(flat[i::3]) for i in range(3))
    assert hv < 1e-5 * hh and vv < hh
