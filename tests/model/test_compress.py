"""Compression: the matched filter applied afterwards gives what `echo` gives compressed."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.reference.equations import point_echo as exact_echo

TOLERANCE = {
    "echo": 1e-5,  # asked of both echoes; their difference is at most twice that
    "matched filter": 2e-7,  # one product in complex64 against the float64 one, relative to the largest sample
    "profile": 1e-3,  # of the peak: a chirp's band cut off by the sampled one makes no more at the peak itself
}
POINTS = np.array([[0.0, 0, 0], [3, -2, 1], [-4, 5, 0]])
SCENE = sarcl.Scene.points(POINTS, [1, 0.5j, -0.7])
TRACK = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.05, n_pulses=5, prf=100.0)
RATE = 2e8


def hanning_chirp(n=201):
    t = (np.arange(n) - (n - 1) / 2) / RATE
    return np.hanning(n) * np.exp(1j * np.pi * 1.5e8 / 1e-6 * t**2)


WAVES = {
    "chirp": sarcl.Waveform.chirp(center=9.6e9, bandwidth=RATE, duration=1e-6),
    "short chirp": sarcl.Waveform.chirp(center=9.6e9, bandwidth=RATE, duration=1e-9),
    "tone": sarcl.Waveform.tone(center=9.6e9, duration=2e-8),
    "sampled": sarcl.Waveform.sampled(hanning_chirp(), RATE, 9.6e9),
}


def relative(a, b):
    return np.linalg.norm(a - b) / np.linalg.norm(b)


def frequencies(raw):
    return raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)


def made_directly_at(raw, wave):
    """The echo equation, compressed, in float64 at the frequencies of `raw`."""
    f = frequencies(raw)
    rows = [
        exact_echo(POINTS, SCENE.amplitudes, f, *row) for row in zip(raw.tx, raw.rx, raw.reference_range, strict=True)
    ]
    return np.stack(rows) * wave.matched_spectrum(f)


@pytest.mark.parametrize("name", WAVES)
def test_compressing_gives_the_compressed_echo_of_the_same_frequencies(device, name):
    wave = WAVES[name]
    later = sarcl.compress(sarcl.echo(SCENE, wave, TRACK, compressed=False, tolerance=TOLERANCE["echo"], device=device))
    assert later.compressed and later.waveform is wave
    assert relative(later.samples, made_directly_at(later, wave)) <= 2 * TOLERANCE["echo"]


@pytest.mark.parametrize("name", WAVES)
def test_compressing_equals_echoing_compressed_where_their_frequencies_are_equal(name):
    # the uncompressed window is longer by the pulse: a window as much wider has the same frequencies
    wave, half = WAVES[name], 12.0
    longer = half + SPEED_OF_LIGHT * wave.duration / 4
    options = {"tolerance": TOLERANCE["echo"]}
    later = sarcl.echo(SCENE, wave, TRACK, compressed=False, range_window=(-half, half), **options)
    at_once = sarcl.echo(SCENE, wave, TRACK, range_window=(-longer, longer), **options)
    assert (frequencies(later) == frequencies(at_once)).all() and not later.compressed
    assert relative(sarcl.compress(later).samples, at_once.samples) <= 2 * TOLERANCE["echo"]


@pytest.mark.parametrize("name", WAVES)
def test_the_matched_filter_is_the_conjugate_of_the_pulse(name):
    raw = sarcl.echo(SCENE, WAVES[name], TRACK, compressed=False)
    wanted = raw.samples * np.conj(WAVES[name].pulse_spectrum(frequencies(raw)))
    error = np.abs(sarcl.compress(raw).samples - wanted).max()
    assert error <= TOLERANCE["matched filter"] * np.abs(wanted).max()


def test_a_chirped_point_becomes_a_peak_at_its_delay():
    wave = WAVES["chirp"]
    raw = sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), wave, TRACK, compressed=False)
    delay, spread = raw.time_signal()
    _, sharp = sarcl.compress(raw).time_signal()
    at_zero = np.abs(sharp[0, delay == 0])
    assert at_zero == pytest.approx(raw.n_samples, rel=TOLERANCE["profile"])
    # the pulse is spread over its duration: lower by about the root of its time-bandwidth product, 200
    assert np.abs(spread).max() < 2 * at_zero / np.sqrt(200)


def test_everything_else_stays_as_it_was():
    raw = sarcl.echo(SCENE, WAVES["chirp"], TRACK, compressed=False)
    done = sarcl.compress(raw)
    for name in ("frequency", "frequency_step", "tx", "rx", "reference_range", "time", "polarization"):
        assert (getattr(done, name) == getattr(raw, name)).all()
    assert done.report is raw.report and not raw.compressed and done.samples.dtype == raw.samples.dtype


def test_compressed_data_come_back_as_they_are():
    raw = sarcl.echo(SCENE, WAVES["chirp"], TRACK)
    assert sarcl.compress(raw) is raw and sarcl.compress(raw, WAVES["tone"]) is raw


def test_complex128_stays_complex128():
    raw = sarcl.echo(SCENE, WAVES["tone"], TRACK, compressed=False)
    assert sarcl.compress(replace(raw, samples=raw.samples.astype(np.complex128))).samples.dtype == np.complex128


def test_rows_may_have_frequencies_of_their_own():
    raw = sarcl.echo(SCENE, WAVES["sampled"], TRACK, compressed=False)
    shifted = replace(raw, frequency=raw.frequency + 1e5 * np.arange(5), frequency_step=raw.frequency_step[0] * 0.9)
    done = sarcl.compress(shifted)
    for p in range(5):
        f = shifted.frequency[p] + shifted.frequency_step[p] * np.arange(raw.n_samples)
        wanted = raw.samples[p] * np.conj(WAVES["sampled"].pulse_spectrum(f))
        assert np.abs(done.samples[p] - wanted).max() <= TOLERANCE["matched filter"] * np.abs(wanted).max()


def test_samples_in_a_file_are_compressed_too(tmp_path):
    raw = sarcl.echo(SCENE, WAVES["chirp"], TRACK, compressed=False)
    with h5py.File(tmp_path / "raw.h5", "w") as file:
        lazy = replace(raw, samples=file.create_dataset("samples", data=raw.samples))
        assert (sarcl.compress(lazy).samples == sarcl.compress(raw).samples).all()


def test_one_pulse_of_one_sample_is_compressed():
    raw = sarcl.PhaseHistory(
        [[2j]], frequency=9.65e9, frequency_step=1e6, tx=[[1e4, 0, 0]], reference_range=1e4, compressed=False
    )
    wanted = 2j * np.conj(WAVES["chirp"].pulse_spectrum(9.65e9))
    assert sarcl.compress(raw, WAVES["chirp"]).samples[0, 0] == pytest.approx(wanted)


def test_data_of_an_unknown_pulse_cannot_be_compressed():
    raw = replace(sarcl.echo(SCENE, WAVES["chirp"], TRACK, compressed=False), waveform=None)
    with pytest.raises(ValueError, match=r"raw names no waveform.*pass compress\(raw, waveform\)"):
        sarcl.compress(raw)
    assert sarcl.compress(raw, WAVES["chirp"]).waveform is WAVES["chirp"]
    with pytest.raises(TypeError, match=r"waveform is a str; give a sarcl\.Waveform"):
        sarcl.compress(raw, "chirp")


def test_backprojection_refuses_what_is_not_compressed():
    raw = sarcl.echo(SCENE, WAVES["chirp"], TRACK, compressed=False)
    with pytest.raises(ValueError, match=r"not compressed.*sarcl\.compress\(raw\)"):
        sarcl.backproject(raw, sarcl.ImageGrid.plane(shape=4, spacing=1))
    assert np.isfinite(sarcl.backproject(sarcl.compress(raw), sarcl.ImageGrid.plane(shape=4, spacing=1)).data).all()
