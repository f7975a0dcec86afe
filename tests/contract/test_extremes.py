"""Tasks at the ends of what is legal: images and echoes are right there, or refused in words; never a crash."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import noise_on, planned_within, thinned

import sarcl
from sarcl.base import host_memory
from sarcl.base.errors import ToleranceUnreachable
from sarcl.opencl.choose_device import open_device

OVERHEAD = np.stack([np.zeros(16), np.linspace(-5, 5, 16), np.full(16, 1e3)], axis=1)


@pytest.mark.parametrize("spacing", [1e-20, 1e-26, 1e-50, 5e-324])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-8])
def test_pixels_closer_than_float32_resolves_are_all_alike(spacing, tolerance):
    raw = noise_on(OVERHEAD, n_samples=32)
    image = sarcl.backproject(raw, sarcl.ImageGrid.plane(shape=(20, 20), spacing=spacing), tolerance=tolerance)
    wanted = sarcl.backproject(raw, sarcl.ImageGrid.points([[0.0, 0, 0]]), tolerance=1e-8).data[0]
    assert np.abs(image.data - wanted).max() <= 10 * tolerance * abs(wanted)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-8])
def test_one_pulse_straight_above_one_pixel_is_focused(tolerance):
    raw = noise_on(OVERHEAD[:1] * [1, 0, 1], n_samples=32)
    image = sarcl.backproject(raw, sarcl.ImageGrid.plane(shape=1, spacing=0.1), tolerance=tolerance)
    wanted = sarcl.backproject(raw, sarcl.ImageGrid.points([[0.0, 0, 0]]), tolerance=1e-8).data[0]
    assert np.abs(image.data - wanted).max() <= 10 * tolerance * abs(wanted)


@pytest.fixture
def near_facets():
    """Two facets 0.3 m from the antennas, which must be cut small."""
    square = np.array([[[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], [[0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]]])
    track = sarcl.Trajectory.line(start=(0, -0.5, 0.3), velocity=(0, 1, 0), prf=16.0, n_pulses=16)
    chirp = sarcl.Waveform.chirp(center=9e9, bandwidth=1e9, duration=1e-6)
    return sarcl.Scene.facets(square, two_sided=True), chirp, track


@pytest.mark.slow
def test_facets_may_be_cut_in_268_mb_whatever_max_bytes_is(near_facets):
    with pytest.raises(ToleranceUnreachable, match=r"more than 524,288 .*max_bytes, 268 MB"):
        sarcl.plan(sarcl.echo, *near_facets, max_bytes=1e7, tolerance=1e-5)


def test_facets_are_cut_within_the_memory_for_them(near_facets):
    with pytest.raises(ToleranceUnreachable, match=r"more than 19,531 .*max_bytes, 10 MB.*or a larger max_bytes"):
        planned_within({"host": 1e7}, sarcl.echo, *near_facets, tolerance=1e-4).forecast()
    planned_within({"host": 1e7}, sarcl.echo, *near_facets, tolerance=0.1).forecast()


def test_the_memory_for_facets_is_max_bytes_or_a_quarter_of_what_is_installed(near_facets, monkeypatch):
    def memory(**options):
        return sarcl.echo.planned(*near_facets, **options).task.request.host

    assert memory(max_bytes=1e9) == 1e9 and memory(max_bytes=1e7) == 2**28
    monkeypatch.setattr(host_memory, "installed", lambda: 8e9)
    assert memory() == 2e9


def test_masked_values_are_refused_wherever_samples_come_from(tmp_path):
    raw = noise_on(OVERHEAD, n_samples=32)
    mask = np.zeros(raw.samples.shape, bool)
    mask[3, 5] = mask[4] = True
    masked = np.ma.masked_array(raw.samples, mask=mask, fill_value=1e20)
    with pytest.raises(ValueError, match=r"samples has 33 masked values, the first at \[3, 5\].*samples\.filled\(0\)"):
        replace(raw, samples=masked)

    class Lazy:  # such as a variable of a netCDF file
        shape, dtype = masked.shape, masked.dtype

        def __getitem__(self, rows):
            return masked[rows]

    lazy = replace(raw, samples=Lazy())
    grid = sarcl.ImageGrid.plane(shape=8, spacing=0.1)
    with pytest.raises(ValueError, match=r"masked values, the first at \[3, 5\]"):
        sarcl.backproject(lazy, grid)
    with pytest.raises(ValueError, match="image data has 1 masked values, the first at"):
        sarcl.Image(np.ma.masked_array(np.ones((8, 8), "c8"), mask=np.arange(64).reshape(8, 8) == 9), grid)
    unmasked = replace(raw, samples=np.ma.masked_array(raw.samples, mask=np.zeros_like(mask)))
    assert type(unmasked.samples) is np.ndarray and np.array_equal(unmasked.samples, raw.samples)


@pytest.mark.parametrize("offset, tolerance", thinned([6.4e6, 1e8, 1e9], [1e-3, 1e-5, 1e-6]))
def test_planes_far_from_the_origin_keep_what_is_predicted(offset, tolerance):
    center = offset * np.array([1, 0.5, -0.25])
    tx = np.stack([np.full(64, -3e3), np.linspace(-50, 50, 64), np.full(64, 4e3)], axis=1)
    raw = replace(noise_on(tx), tx=tx + center)
    grid = sarcl.ImageGrid.plane(center=center, shape=(40, 40), spacing=0.3, x_axis=(0.8, 0.6, 0))
    report = sarcl.backproject(raw, grid, tolerance=tolerance, check=True).report
    assert report.measured_error <= report.predicted_error <= tolerance
    if offset == 1e9 and tolerance == 1e-6:
        assert report.plan["ranges"] == "float64"
        with pytest.raises(ToleranceUnreachable, match="coordinates this large are rounded by 3e-05 rad") as caught:
            sarcl.backproject(raw, grid, tolerance=tolerance, device=open_device().without_fp64())
        assert "put the origin near the scene" in str(caught.value) and 5e-5 < caught.value.best < 1e-4


def tones(duration, **options):
    """Echoes of two points with three carriers 1 MHz apart, and the documented sum, (4, n_samples) each."""
    tone = sarcl.Waveform.tone(center=1e10, duration=duration)
    array = sarcl.AntennaArray.linear(3, spacing=0.015, frequency_step=1e6)
    track = sarcl.Trajectory.line(start=(0, -2, 1e3), velocity=(0, 1, 0), prf=1.0, n_pulses=4)
    scene = sarcl.Scene.points([[0, 0, 0], [1.0, 2, 0]], [1, 0.5j])
    raw = sarcl.echo(scene, tone, track, array=array, reference=(0, 0, 0), range_window=(-30, 30), **options)
    f = raw.frequency[:, None] + raw.frequency_step[:, None] * np.arange(raw.n_samples)
    wanted = np.zeros(f.shape, complex)
    for n in range(3):
        own = np.abs(f - 1e10 - n * 1e6) < 0.5e6
        matched = np.sinc((f - 1e10 - n * 1e6) * duration) ** 2 * own
        for x, a in zip(scene.positions, scene.amplitudes, strict=True):
            ways = (np.linalg.norm(p - x, axis=1) for p in (track.positions + array.positions[n], track.positions))
            excess = sum(ways) - 2 * raw.reference_range
            wanted += a * matched * np.exp(-2j * np.pi / 299792458 * f * excess[:, None])
    return raw, wanted


def test_tones_are_cut_half_way_to_their_neighbours_as_the_documented_equation_says():
    with pytest.warns(sarcl.SarclWarning, match=r"shorter than 1/\|df\| = 1e-06 s: .* leaves out 96 % of its spectrum"):
        raw, wanted = tones(50e-9)
    assert np.linalg.norm(raw.samples - wanted) <= 1e-3 * np.linalg.norm(wanted)
    assert raw.report.plan["tone spectra"] == "cut half-way to the next carriers: 96 % of their norm is left out"


def test_tones_as_long_as_the_carriers_need_are_whole():
    raw, wanted = tones(1e-6)
    assert np.linalg.norm(raw.samples - wanted) <= 1e-3 * np.linalg.norm(wanted)
    assert "tone spectra" not in raw.report.plan
