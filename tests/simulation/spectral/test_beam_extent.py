"""What a beam receives beyond the aspects of most scatterers: on short tracks it is not cut off, or it is predicted."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import thinned

import sarcl
from sarcl import pointing
from sarcl.model.antenna_pattern import two_way_gain
from sarcl.reference.equations import point_echo as exact_echo
from sarcl.scattering.antenna_weights import weights_of
from sarcl.scattering.scatterers import Points
from sarcl.simulation.spectral._beam_extent import beam_extent
from sarcl.simulation.spectral._scatterer_amplitudes import ScattererAmplitudes
from sarcl.simulation.spectral._straight_track import straight_track

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=20e6, duration=1e-6)
SMALL = sarcl.Antenna.rectangular(size=(0.3, 0.3))
BRIGHT_EDGE = sarcl.Antenna.rectangular(size=(2.0, 0.3))


def short_track(n=128, distance=1e4, squint=0.0, spacing=0.14):
    track = sarcl.Trajectory.line(
        start=(-0.8 * distance, -spacing * n / 2, 0.6 * distance), velocity=(0, 100, 0), prf=100 / spacing, n_pulses=n
    )
    return pointing.stripmap(track, look=np.arctan2(8, 6), side="right", squint=squint)


def points(n=2000, extent=1e3, along=0.0, seed=0):
    random = np.random.default_rng(seed)
    places = np.c_[random.uniform(-0.5, 0.5, (n, 2)) * extent, np.zeros(n)] + (0, along, 0)
    return sarcl.Scene.points(places, np.exp(2j * np.pi * random.random(n)))


def achieved(raw, scene, track, antenna, some):
    """Relative error of the samples of some pulses against the sum over points, in float64."""
    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    wanted = []
    for p in some:
        at = np.broadcast_to(track.positions[p], scene.positions.shape)
        gains = [two_way_gain((antenna, antenna), (track.attitude[p],) * 2, at, at, scene.positions, g) for g in f[::8]]
        rows = [
            exact_echo(scene.positions, scene.amplitudes * gain, f[8 * i : 8 * i + 1], raw.tx[p], raw.tx[p],
                       raw.reference_range[p])
            for i, gain in enumerate(gains)
        ]  # fmt: skip
        wanted.append(np.concatenate(rows))
    return np.linalg.norm(raw.samples[some][:, ::8] - wanted) / np.linalg.norm(wanted)


@pytest.mark.parametrize("n_pulses, tolerance", thinned([2, 3, 128], [1e-2, 1e-3]))
def test_the_edges_of_a_scene_are_not_cut_off_on_a_short_track(n_pulses, tolerance):
    track, scene = short_track(n_pulses), points(500)
    raw = sarcl.spectral_echo(scene, CHIRP, track, antenna=SMALL, tolerance=tolerance)
    error = achieved(raw, scene, track, SMALL, list(range(0, n_pulses, max(1, n_pulses // 3))))
    assert error <= raw.report.predicted_error <= tolerance


def test_one_bright_point_among_many_is_not_cut_off():
    track, scene = short_track(), points(2000)
    amplitudes = scene.amplitudes.copy()
    far = int(np.argmax(scene.positions[:, 1]))
    amplitudes[far] = 300.0  # in a side lobe
    scene = sarcl.Scene.points(scene.positions, amplitudes)
    raw = sarcl.spectral_echo(scene, CHIRP, track, antenna=BRIGHT_EDGE, tolerance=1e-2)
    assert achieved(raw, scene, track, BRIGHT_EDGE, [0, 64]) <= raw.report.predicted_error <= 1e-2


def test_side_lobes_under_squint_are_not_cut_off():
    track = short_track(24, squint=0.3)
    scene = points(300, extent=1e3, along=1e4 * np.tan(0.3))
    raw = sarcl.spectral_echo(scene, CHIRP, track, antenna=SMALL, tolerance=3e-3)
    assert achieved(raw, scene, track, SMALL, [0, 20]) <= raw.report.predicted_error <= 3e-3


@pytest.mark.parametrize("diagram", [pytest.param("smooth", marks=pytest.mark.slow), "cos"])
def test_facets_at_the_edges_of_a_scene_are_not_cut_off(diagram):
    """12 m at 120 m: the angles of 1 km at 10 km."""
    n, random = 12, np.random.default_rng(0)
    x = np.linspace(-6, 6, n + 1)
    corners = np.stack([*np.meshgrid(x, x, indexing="ij"), random.normal(scale=0.1, size=(n + 1, n + 1))], axis=-1)
    a, b, c, d = corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]
    triangles = np.concatenate([np.stack(one, axis=-2).reshape(-1, 3, 3) for one in ((a, b, c), (a, c, d))])
    scene = sarcl.Scene.facets(triangles, material=sarcl.Material(eps_r=5, diagram=diagram))
    track = short_track(16, distance=120.0)
    chirp = sarcl.Waveform.chirp(center=1.2e9, bandwidth=20e6, duration=1e-6)
    antenna = sarcl.Antenna.rectangular(size=(2.4, 2.4))
    raw = sarcl.spectral_echo(scene, chirp, track, antenna=antenna, tolerance=2e-2, shadows=False, check=True)
    assert raw.report.measured_error <= raw.report.predicted_error <= 2e-2


def extent_of(scene, track, antenna, allowed):
    """The extent, and the energies of scatterers by pulse, with their sines, (n_points, n_pulses) each."""
    weights = weights_of(antenna, None, track, None, CHIRP, scene.center)
    line = straight_track(track, 9.7e9, 1e-3)
    made = ScattererAmplitudes(
        Points(scene.positions, scene.amplitudes), weights, line, ("HH",), np.array([0.0, 0.0, 1.0])
    )
    extent = beam_extent(made, made.sines(0.0), made.sines(line.length), (9.59e9, 9.61e9), allowed)
    away = track.positions[None] - scene.positions[:, None]
    gains = np.stack([
        two_way_gain((antenna, antenna), (track.attitude[0],) * 2, *(np.tile(at, (len(scene.positions), 1)),) * 2,
                     scene.positions, 9.6e9)
        for at in track.positions
    ], axis=1)  # fmt: skip
    return extent, np.abs(scene.amplitudes[:, None] * gains) ** 2, away[..., 1] / np.linalg.norm(away, axis=2)


@pytest.mark.parametrize(("n_pulses", "size"), [(16, 0.6), (128, 1.0), (1500, 2.0)])
def test_what_limits_leave_out_is_the_energy_beyond_them(n_pulses, size):
    scene, track = points(1000), short_track(n_pulses)
    extent, energy, sines = extent_of(scene, track, sarcl.Antenna.rectangular(size=(size, 0.3)), 3e-2)
    beyond = (sines < extent.low) | (sines > extent.high)
    true = np.sqrt(energy[beyond].sum() / energy.sum())
    assert 0 < true <= extent.outside <= min(3 * true, 3e-2)


@pytest.mark.parametrize("many", [1, 2000])
def test_faint_points_in_a_side_lobe_beside_strong_ones_near_a_null_are_not_cut_off(many):
    """Drawn by size they were missed: 1.7e-4 of the echo was cut off where 1.3e-5 were predicted."""
    track = short_track(13, distance=8e4)
    sines = np.repeat([0.0, -0.0836, 0.1118], many)  # the main lobe, a side lobe, near the null of 0.558 m
    sizes = np.repeat([19.0, 0.085, 3.3], many)
    places = np.c_[np.linspace(-30, 30, 3 * many), 8e4 * np.tan(np.arcsin(sines)), np.zeros(3 * many)]
    antenna = sarcl.Antenna.rectangular(size=(0.558, 0.3))
    extent, energy, found = extent_of(sarcl.Scene.points(places, sizes), track, antenna, 4.5e-5)
    beyond = (found < extent.low) | (found > extent.high)
    assert np.sqrt(energy[beyond].sum() / energy.sum()) <= extent.outside + 1e-9 <= 4.6e-5


def test_scatterers_that_send_nothing_back_do_not_widen_the_aspects():
    scene, track = points(1000), short_track()
    faint = np.where(np.abs(scene.positions[:, 1]) > 100, 1e-9, 1.0) * scene.amplitudes
    extent, *_ = extent_of(sarcl.Scene.points(scene.positions, faint), track, SMALL, 1e-3)
    assert -0.012 < extent.low < -0.01 < 0.01 < extent.high < 0.012


def test_pulses_that_hardly_see_the_scene_are_no_measure_of_the_error():
    track = sarcl.Trajectory.line(start=(-800, -300, 600), velocity=(0, 100, 0), prf=400, n_pulses=2400)
    track = pointing.stripmap(track, look=np.arctan2(8, 6), side="right")
    raw = sarcl.spectral_echo(
        points(30, extent=3.0), CHIRP, track, antenna=sarcl.Antenna.gaussian(width=(0.01, 0.1)), tolerance=1e-2,
        check=True,
    )  # fmt: skip
    power = (np.abs(raw.samples) ** 2).sum(axis=1)
    assert (power > 1e-3 * power.max()).mean() < 0.06
    assert raw.report.measured_error <= raw.report.predicted_error <= 1e-2


def test_ranges_at_other_elevations_of_the_beam_keep_the_error():
    """Away from the strongest scatterers the amplitudes are other sums of the functions of the aspect."""
    random = np.random.default_rng(2)
    track = sarcl.Trajectory.line(start=(-1040, -0.29, 500), velocity=(0, 100, 0), prf=863, n_pulses=6)
    track = pointing.stripmap(track, look=np.arctan2(1040, 500), side="right")
    places = np.c_[random.uniform(-73, 73, 600), random.uniform(-2.2, 2.2, 600), np.zeros(600)]
    scene = sarcl.Scene.points(places, np.exp(2j * np.pi * random.random(600)))
    chirp = sarcl.Waveform.chirp(center=28.9e9, bandwidth=1.67e9, duration=1e-6)
    antenna = sarcl.Antenna.rectangular(size=(0.42, 0.31), taper=0.3)
    raw = sarcl.spectral_echo(scene, chirp, track, antenna=antenna, tolerance=8e-3, check=True)
    assert raw.report.measured_error <= raw.report.predicted_error <= 8e-3


@pytest.mark.parametrize("n_pulses", [2, 6])
def test_a_beam_that_passes_the_scene_between_two_pulses_is_not_cut_off(n_pulses):
    """All that pulses receive are side lobes then: 0.1 m of scene, 0.15 m of beam, pulses 0.7 m apart."""
    random = np.random.default_rng(n_pulses)
    track = sarcl.Trajectory.line(
        start=(-10, -0.35 - 0.7 * (n_pulses // 2 - 1), 10), velocity=(0, 100, 0), prf=100 / 0.7, n_pulses=n_pulses
    )
    track = pointing.stripmap(track, look=np.pi / 4, side="right")
    scene = sarcl.Scene.points(random.uniform(-0.05, 0.05, (50, 3)) * (1, 1, 0), np.exp(6j * random.random(50)))
    antenna = sarcl.Antenna.rectangular(size=(3.0, 0.2), taper=0.3)
    raw = sarcl.spectral_echo(scene, CHIRP, track, antenna=antenna, tolerance=2e-2)
    assert achieved(raw, scene, track, antenna, list(range(n_pulses))) <= raw.report.predicted_error <= 2e-2
