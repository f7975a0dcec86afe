"""Noise on echoes: its level in images, its statistics, and its independence of blocks and row selection."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.effects.noise import add_noise, cell_area, complex_gaussian
from sarcl.model.radar import BOLTZMANN, Radar, noise_variance, spreading

FC, BAND, DURATION = 9.6e9, 150e6, 5e-6
CHIRP = sarcl.Waveform.chirp(center=FC, bandwidth=BAND, duration=DURATION)
RANGE, LOOK = 8e3, 0.8
HEIGHT, GROUND = RANGE * np.cos(LOOK), RANGE * np.sin(LOOK)
TRACK = sarcl.Trajectory.line(start=(-GROUND, -64, HEIGHT), velocity=(0, 100, 0), prf=100, n_pulses=129)
CELL = SPEED_OF_LIGHT / (2 * BAND * np.sin(LOOK)) * SPEED_OF_LIGHT / FC * RANGE / (2 * 129)  # range x cross-range, m^2


def silence(n_samples=128, dtype=np.complex64, **more):
    """Rows without any echo."""
    n = len(TRACK)
    samples = np.zeros((n, n_samples), dtype)
    return sarcl.PhaseHistory(
        samples, FC - BAND / 2 + BAND / n_samples / 2, BAND / n_samples, TRACK.positions, RANGE, **more
    )


def grid(n=80, spacing=1.7):
    return sarcl.ImageGrid.plane(shape=(n, n), spacing=(spacing, spacing))


def test_the_cell_is_range_cell_on_the_ground_times_cross_range_cell():
    assert cell_area(silence(), (0, 0, 0)) == pytest.approx(CELL, rel=2e-3)
    # a plane tilted to face the radar has the slant range cell
    tilted = cell_area(silence(), (0, 0, 0), np.cross([-np.sin(LOOK), 0, np.cos(LOOK)], [0, 1, 0]))
    assert tilted == pytest.approx(CELL * np.sin(LOOK), rel=2e-3)


def test_the_cell_is_the_integral_of_the_response_where_pulses_are_uneven_and_the_band_is_wide():
    y = 64 * np.sinh(np.linspace(-2, 2, 129)) / np.sinh(2)  # spacings from 1 to 3.6
    tx = np.stack([np.full(129, -GROUND), y, np.full(129, HEIGHT)], axis=1)
    raw = sarcl.PhaseHistory(
        np.zeros((129, 64), np.complex64), 4.8e9, 150e6, tx, reference_range=np.linalg.norm(tx, axis=1)
    )  # 4.8 to 14.4 GHz
    x, along = np.arange(-0.69, 0.69, 0.006), np.arange(-40, 40, 0.25)
    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    look = -tx / np.linalg.norm(tx, axis=1, keepdims=True)  # plane waves at the point
    k = 4 * np.pi / SPEED_OF_LIGHT * f[None, :, None] * look[:, None, :2]
    k = k.reshape(-1, 2)
    response = sum(
        np.einsum("sx,sy->xy", np.exp(1j * np.outer(part[:, 0], x)), np.exp(1j * np.outer(part[:, 1], along)))
        for part in np.array_split(k, 64)
    )
    area = (np.abs(response) ** 2).sum() * 0.006 * 0.25 / len(k) ** 2
    assert cell_area(raw, (0, 0, 0)) == pytest.approx(area, rel=0.03)


def test_the_nesz_holds_for_spectra_that_are_not_flat():
    t = np.arange(-200, 201) / (4 * BAND)
    pulse = sarcl.Waveform.sampled(np.exp(-np.pi * (BAND / 3 * t) ** 2), 4 * BAND, FC)
    noisy = add_noise(silence(waveform=pulse), nesz=0.5, cell_area=CELL, seed=5)
    power = (np.abs(noisy.samples[:]) ** 2).mean()  # of a pixel it is this over the number of samples
    assert power == pytest.approx(0.5 * CELL * noisy.n_rows * noisy.n_samples, rel=0.05)


@pytest.mark.parametrize("window, widening", [(None, 1.0), ("hamming", 1.36**2)])
@pytest.mark.parametrize("nesz_db", [-22.0, 3.0])
def test_an_image_of_noise_has_the_nesz_asked_for(window, widening, nesz_db):
    noisy = add_noise(silence(), nesz_db=nesz_db, grid=grid(), seed=3)
    image = sarcl.backproject(noisy, grid(), window=window)
    power = np.abs(image.data / image.gain) ** 2
    # pixels a cell apart are independent, those of wider cells are not; four standard deviations
    got = power.mean() / (CELL * widening)
    assert got == pytest.approx(10 ** (nesz_db / 10), rel=4 * np.sqrt(widening) / 80 + 0.004)
    # every pixel is an exponential variable: the mean square of a power is twice the square of its mean
    assert (power**2).mean() == pytest.approx(2 * power.mean() ** 2, rel=0.15)


def test_noise_at_a_nesz_is_as_bright_as_ground_of_that_sigma_zero():
    sigma_zero, half, n = 0.05, 60.0, 12000  # what is 125 m apart along the track is ambiguous
    random = np.random.default_rng(4)
    places = np.concatenate([random.uniform(-half, half, (n, 2)), np.zeros((n, 1))], axis=1)
    amplitude = np.sqrt(sigma_zero * (2 * half) ** 2 / n) * np.exp(2j * np.pi * random.uniform(size=n))
    raw = sarcl.echo(sarcl.Scene.points(places, amplitude), CHIRP, TRACK, reference=(0, 0, 0))
    g = grid(48, 2.0)
    ground = sarcl.backproject(raw, g)
    noisy = add_noise(replace(raw, samples=np.zeros_like(raw.samples)), nesz=sigma_zero, grid=g, seed=5)
    noise = sarcl.backproject(noisy, g)
    levels = [(np.abs(image.data / image.gain) ** 2).mean() for image in (ground, noise)]
    assert levels[0] == pytest.approx(levels[1], rel=6 / 48)


def test_polarisations_have_the_same_nesz_each():
    pair = np.tile(["HH", "VV"], len(TRACK))
    raw = silence()
    both = sarcl.PhaseHistory(
        np.zeros((2 * len(TRACK), 128), np.complex64), raw.frequency[0], raw.frequency_step[0],
        np.repeat(TRACK.positions, 2, axis=0), RANGE, polarization=pair,
    )  # fmt: skip
    noisy = add_noise(both, nesz_db=-20, grid=grid(), seed=1)
    one = add_noise(raw, nesz_db=-20, grid=grid(), seed=1)
    assert noisy.samples.deviation == pytest.approx(one.samples.deviation[0])
    vv = sarcl.backproject(noisy.select(polarization="VV"), grid(60))
    assert (np.abs(vv.data / vv.gain) ** 2).mean() / CELL == pytest.approx(0.01, rel=0.07)


def test_noise_is_white_and_complex_normal():
    z = complex_gaussian(np.arange(200), 500, 7)
    for part in (z.real, z.imag):
        assert stats.kstest(part.ravel() * np.sqrt(2), "norm").pvalue > 0.01
    assert stats.kstest(np.abs(z.ravel()) ** 2, "expon").pvalue > 0.01
    for other in (
        z[1:] * z[:-1].conj(),
        z[:, 1:] * z[:, :-1].conj(),
        z * complex_gaussian(np.arange(200), 500, 8).conj(),
        z * z,
    ):
        assert abs(other.mean()) < 4 / np.sqrt(z.size)


def test_noise_belongs_to_rows_and_columns_whatever_is_read():
    noisy = add_noise(silence(), variance=2.0, seed=9)
    whole = noisy.read(0, noisy.n_rows)
    assert np.array_equal(np.concatenate([noisy.read(i, min(i + 10, 129)) for i in range(0, 129, 10)]), whole)
    assert np.array_equal(noisy[::-3].read(0, 43), whole[::-3])
    assert np.array_equal(noisy[noisy.tx[:, 1] > 0].read(5, 9), whole[noisy.tx[:, 1] > 0][5:9])
    assert np.array_equal(add_noise(silence(), variance=2.0, seed=9).read(0, 129), whole)
    other = add_noise(silence(), variance=2.0, seed=10).read(0, 129)
    assert abs((other * whole.conj()).mean()) < 8 / np.sqrt(whole.size)
    assert (np.abs(whole) ** 2).mean() == pytest.approx(2.0, rel=4 / np.sqrt(whole.size))
    assert whole.dtype == np.complex64 and add_noise(silence(dtype=complex), variance=1.0).samples.dtype == complex


def test_noise_is_added_to_what_is_there_and_saved_as_it_is_read(tmp_path):
    raw = sarcl.echo(sarcl.Scene.points([[0, 0, 0]], [1.0]), CHIRP, TRACK)
    noisy = add_noise(raw, variance=1e-4, seed=2)
    difference = noisy.read(0, 129) - raw.read(0, 129)
    assert np.abs(difference).max() < 0.1 and (np.abs(difference) ** 2).mean() == pytest.approx(1e-4, rel=0.05)
    noisy.save(tmp_path / "noisy.h5")
    again = sarcl.read(tmp_path / "noisy.h5")
    assert np.array_equal(again.read(0, 129), noisy.read(0, 129))


def test_variance_may_change_from_row_to_row():
    deviation = np.linspace(0, 3, 129)
    got = add_noise(silence(4096), variance=deviation**2).read(0, 129)
    assert np.abs(np.sqrt((np.abs(got) ** 2).mean(axis=1)) - deviation).max() < 0.15
    assert not got[0].any()


def test_noise_takes_the_shape_of_the_matched_filter():
    tone = sarcl.Waveform.tone(center=FC, duration=4 / BAND)
    shaped = add_noise(silence(64, waveform=tone), nesz_db=0, cell_area=1.0).samples
    f = FC + BAND * ((np.arange(64) + 0.5) / 64 - 0.5)
    assert np.allclose(shaped.profile, np.abs(np.sinc((f - FC) * 4 / BAND)))
    flat = add_noise(silence(64, waveform=tone, compressed=False), nesz_db=0, cell_area=1.0)
    assert (flat.samples.profile == 1).all()
    # compressed before or after: the same level
    after = sarcl.compress(flat).read(0, 129)
    before = add_noise(silence(64, waveform=tone), nesz_db=0, cell_area=1.0).read(0, 129)
    assert np.allclose(np.abs(after), np.abs(before), rtol=1e-5, atol=1e-6)


def test_the_radar_equation_is_the_product_of_its_factors():
    radar, wave = Radar(power=4e3, losses_db=3), SPEED_OF_LIGHT / FC
    gain_t, gain_r, near, far = 1e4, 2e3, 700e3, 900e3
    wanted = 4e3 * gain_t * gain_r * wave**2 / ((4 * np.pi) ** 3 * near**2 * far**2 * 10**0.3)
    got = radar.amplitude(FC, near, far, np.sqrt(gain_t), np.sqrt(gain_r))
    assert got**2 == pytest.approx(wanted, rel=1e-12)
    assert radar.factor([FC, 2 * FC]) == pytest.approx(radar.factor(FC) * np.array([1, 0.5]))
    with pytest.raises(ValueError, match="stands on a scatterer"):
        spreading([1.0, 0.0], 1.0)


@pytest.mark.parametrize("kind", ["chirp", "tone", "sampled"])
def test_thermal_noise_has_the_variance_of_a_simulated_receiver(kind):
    """k T_s W/Hz of noise through a receiver, in time: its spectrum over a period, over the pulse's largest."""
    rate, period, temperature = 4 * BAND, 20e-6, 500.0
    t = np.arange(-DURATION / 2, DURATION / 2, 1 / rate)
    chirped = np.exp(1j * np.pi * BAND / DURATION * t**2)
    waveform, pulse = {
        "chirp": (CHIRP, chirped),
        "tone": (sarcl.Waveform.tone(center=FC, duration=DURATION), np.ones_like(chirped)),
        "sampled": (sarcl.Waveform.sampled(3 * chirped * np.hanning(len(t)), rate, FC), chirped * np.hanning(len(t))),
    }[kind]
    spectrum = np.abs(np.fft.fft(pulse, 2**16)) / rate
    # a chirp's is flat but for Fresnel's ripples, which its stationary-phase spectrum leaves out
    f = np.abs(np.fft.fftfreq(2**16, 1 / rate))
    peak = np.sqrt((spectrum[f < 0.3 * BAND] ** 2).mean()) if kind == "chirp" else spectrum.max()
    assert waveform.peak_energy_density == pytest.approx(peak**2, rel=0.01)
    n = round(rate * period)
    random = np.random.default_rng(6)
    receiver = random.normal(size=(40, n, 2)) @ [1, 1j] * np.sqrt(BOLTZMANN * temperature * rate / 2)
    variance = (np.abs(np.fft.fft(receiver) / rate / peak) ** 2).mean()
    raw = sarcl.PhaseHistory(np.zeros((3, 8), np.complex64), FC, 1 / period, np.zeros((3, 3)), RANGE, waveform=waveform)
    assert noise_variance(raw, temperature) == pytest.approx(variance, rel=0.02)


def test_a_point_s_signal_to_noise_ratio_is_energy_over_noise_density():
    radar = Radar(power=1e3, noise_temperature=600.0)
    raw = sarcl.echo(sarcl.Scene.points([[0, 0, 0]], [1.0]), CHIRP, TRACK, range_window=(-100, 100))
    power = float(radar.amplitude(FC, RANGE, RANGE, 100.0, 100.0) ** 2)
    raw = replace(raw, samples=raw.read(0, 129) * np.float32(np.sqrt(power)))
    noisy = add_noise(replace(raw, samples=np.zeros_like(raw.samples)), radar=radar, seed=1)
    g = grid(64, 1.8)
    point, noise = sarcl.backproject(raw, g), sarcl.backproject(noisy, g)
    ratio = np.abs(point.data).max() ** 2 / (np.abs(noise.data) ** 2).mean()
    assert ratio == pytest.approx(power * DURATION * 129 / (BOLTZMANN * 600), rel=0.08)
    same = add_noise(raw, temperature=600.0)
    assert np.array_equal(same.samples.deviation, noisy.samples.deviation)


def circle(n=64, arc=2 * np.pi):
    track = sarcl.Trajectory.circle(radius=5e3, height=5e3, arc=arc, n_pulses=n)
    return sarcl.PhaseHistory(np.zeros((n, 8), np.complex64), FC, BAND / 8, track.positions, 7e3)


def test_a_circle_s_cell_is_that_of_a_ring_of_spatial_frequencies():
    n, f = 2001, FC + BAND * (np.arange(8) / 8 - 0.5 + 0.5 / 8)
    k = 4 * np.pi / SPEED_OF_LIGHT * np.sin(np.pi / 4)
    ring = 2 * np.pi * k**2 * (f * BAND / 8).sum()
    full = circle(n, 2 * np.pi * (n - 1) / n)
    full = replace(full, frequency=np.full(n, f[0]))
    assert cell_area(full, (0, 0, 0)) == pytest.approx((2 * np.pi) ** 2 / ring, rel=2e-3)


BAD = [
    (dict(), "one level"),
    (dict(nesz_db=-20, temperature=3.0), "one level"),
    (dict(nesz_db=-20), "needs the area"),
    (dict(nesz_db=-20, cell_area=1.0, grid=grid(4)), "needs the area"),
    (dict(nesz=-20.0, cell_area=1.0), "nesz_db=-20"),
    (dict(nesz_db=np.nan, cell_area=1.0), "finite"),
    (dict(nesz_db=-20, cell_area=0.0), "greater than 0"),
    (dict(temperature=300.0), "no waveform"),
    (dict(variance=-1.0), "negative"),
    (dict(variance=np.ones(3)), "shape"),
    (dict(variance=1.0, cell_area=2.0), "go with nesz"),
    (dict(variance=1.0, seed=-1), "seed"),
    (dict(radar=Radar(power=1.0)), "noise_temperature"),
    (dict(nesz_db=0, grid=sarcl.ImageGrid.points(np.ones((4, 3)))), "lists its points"),
    (dict(nesz_db=0, grid=sarcl.ImageGrid.plane(center=TRACK.positions[7], shape=2, spacing=1)), "row 7"),
]


@pytest.mark.parametrize("options, says", BAD, ids=[says for _, says in BAD])
def test_noise_of_no_known_level_is_refused(options, says):
    with pytest.raises(ValueError, match=says):
        add_noise(silence(), **options)


def test_rows_that_are_no_single_sweep_need_their_cell_told():
    for raw, says in (
        (circle(arc=4 * np.pi), "do not pass the point in one direction"),
        (silence()[[0, 5, 3, 9]], "do not pass the point in one direction"),
        (silence()[[0]], "one pulse"),
        (silence(tx_channel=np.arange(129) % 2), "several channels"),
    ):
        with pytest.raises(ValueError, match=says):
            add_noise(raw, nesz_db=-20, grid=grid(4))
        add_noise(raw, nesz_db=-20, cell_area=1.0)


@pytest.mark.parametrize("options", [dict(power=0), dict(power=1, losses_db=-3), dict(power=1, noise_temperature=0)])
def test_a_radar_without_power_or_with_negative_losses_is_refused(options):
    with pytest.raises(ValueError, match="radar"):
        Radar(**options)
