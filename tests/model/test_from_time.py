"""Samples in time become the samples over frequency that `echo` gives, and points focus where they are.

Every record is written here from its formula, in longdouble: a pulse that returns, or the product of two sweeps.
"""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT

C = np.longdouble(SPEED_OF_LIGHT)
TURN = 2 * np.arccos(np.longdouble(-1))
TOLERANCE = {
    "float64": 1e-8,  # delays in s as float64: 2e-18 s at 700 km and 3e-24 s at 10 m, times the carrier, and FFTs
    "echo": 2e-6,  # tolerance of echo, twice
    "chirp": 3e-2,  # a rectangular chirp of time-bandwidth product 900 against its stationary-phase spectrum, in energy
    "gain": 2e-3,  # backproject at tolerance 1e-4, interpolated peak
}


def cases():
    """(carrier, rate, n, distance, step along the track, points): L band at 700 km, 77 GHz at 10 m."""
    return {
        "L band at 700 km": (1.2575e9, 32e6, 512, 7e5, 150.0, [[0, 0, 0], [310.0, -200.0, 0], [-255.0, 401.0, 12.0]]),
        "77 GHz at 10 m": (77e9, 2e9, 256, 10.0, 4e-3, [[0, 0, 0], [1.1, 0.4, 0], [-2.03, -0.7, 0.1]]),
    }


AMPLITUDES = np.array([1.0, 0.5j, -0.7])


def geometry(name):
    carrier, rate, n, distance, step, points = cases()[name]
    tx = np.stack([np.full(9, distance * 0.8), step * (np.arange(9) - 4), np.full(9, distance * 0.6)], axis=1)
    return carrier, rate, n, tx, np.array(points)


def delays(tx, points, rx=None):
    """Two-way delays, longdouble (n_rows, n_points)."""
    ends = [
        np.asarray(e, np.longdouble)[:, None] - np.asarray(points, np.longdouble)
        for e in (tx, tx if rx is None else rx)
    ]
    return sum(np.sqrt((d**2).sum(axis=-1)) for d in ends) / C


def turned(cycles):
    """exp(j 2 pi cycles), cycles in longdouble."""
    angle = np.asarray(TURN * (cycles - np.rint(cycles)), np.float64)
    return np.exp(1j * angle)


def over_frequency(raw, tau, amplitudes, spectrum=1.0):
    """The samples that raw should have: a W exp(-j 2 pi f (tau - tau_ref))."""
    f = np.asarray(raw.frequency[:, None], np.longdouble) + np.arange(raw.n_samples) * np.longdouble(
        raw.frequency_step[0]
    )
    away = tau - 2 * np.asarray(raw.reference_range, np.longdouble)[:, None] / C
    return spectrum * sum(a * turned(-f * away[:, [k]]) for k, a in enumerate(amplitudes))


def relative(made, wanted):
    return np.linalg.norm(made - wanted) / np.linalg.norm(wanted)


def echoes(raw, scene, waveform):
    """`echo` of the same frequencies, with its phase moved to raw's reference ranges."""
    half = SPEED_OF_LIGHT / (4 * raw.frequency_step[0]) * (1 - 1e-9)
    made = sarcl.echo(
        scene, waveform, sarcl.Trajectory(np.arange(raw.n_rows), raw.tx), reference=(0, 0, 0),
        range_window=(-half, half), tolerance=1e-6,
    )  # fmt: skip
    assert made.n_samples == raw.n_samples and np.abs(made.frequency - raw.frequency).max() <= 1e-12 * raw.frequency[0]
    moved = np.asarray(raw.reference_range, np.longdouble) - np.asarray(made.reference_range, np.longdouble)
    f = np.asarray(made.frequency[:, None], np.longdouble) + np.arange(raw.n_samples) * np.longdouble(
        raw.frequency_step[0]
    )
    return made.samples * turned(2 * f * moved[:, None] / C)


def focused(raw, spacing):
    """Position and complex value of the brightest point near the origin, of the image about it."""
    grid = sarcl.ImageGrid.plane(shape=(9, 9), spacing=spacing)
    image = sarcl.backproject(raw, grid, tolerance=1e-4)
    return np.unravel_index(np.abs(image.data).argmax(), grid.shape), image.data[4, 4] / image.gain


def gaussian(rate, carrier):
    """A pulse exp(-pi (b t)^2), b = rate/4, sampled; its compressed form is exp(-pi (b t)^2/2)."""
    t = np.arange(-24, 25) / rate
    return sarcl.Waveform.sampled(np.exp(-np.pi * (rate / 4 * t) ** 2), rate, carrier)


@pytest.mark.parametrize("name", cases())
def test_compressed_samples_give_the_echoes_of_the_scene(name):
    carrier, rate, n, tx, points = geometry(name)
    tau = delays(tx, points)
    start = float(tau[4, 0]) - n / 2 / rate + 3.3 / rate + np.linspace(0, 0.5, 9) / rate  # another one in every row
    if name == "77 GHz at 10 m":
        start = np.zeros(9)  # from the transmission on
    t = np.asarray(start, np.longdouble)[:, None] + np.arange(n) / np.longdouble(rate)
    signal = sum(
        a
        * np.exp(-np.pi / 2 * np.asarray(rate / 4 * (t - tau[:, [k]]), np.float64) ** 2)
        * turned(-carrier * tau[:, [k]])
        for k, a in enumerate(AMPLITUDES)
    )
    waveform = gaussian(rate, carrier)
    raw = sarcl.PhaseHistory.from_time(signal, rate=rate, start=start, tx=tx, waveform=waveform, time=np.arange(9))
    middle = SPEED_OF_LIGHT / 2 * (start + (n - 1) / 2 / rate)
    assert raw.compressed and raw.is_monostatic and np.abs(raw.reference_range - middle).max() <= 1e-15 * middle.max()
    f = carrier + (np.arange(n) - (n - 1) / 2) * rate / n
    wanted = over_frequency(raw, tau, AMPLITUDES, waveform.matched_spectrum(f))
    assert relative(raw.samples, wanted) <= TOLERANCE["float64"]
    assert relative(raw.samples, echoes(raw, sarcl.Scene.points(points, AMPLITUDES), waveform)) <= TOLERANCE["echo"]
    at, value = focused(raw, spacing=SPEED_OF_LIGHT / rate / 8)
    assert tuple(at) == (4, 4)
    # gain is the sum of weights; the spectrum of this pulse is not 1 over the band
    assert abs(value / waveform.matched_spectrum(f).mean() - 1) <= 0.02  # side lobes of two more points


@pytest.mark.parametrize("name", cases())
def test_a_compressed_point_has_gain_1_and_phase_0(name):
    carrier, rate, n, tx, points = geometry(name)
    tau = delays(tx, points[:1])
    start = float(tau.mean()) - (n - 1) / 2 / rate + 0.3 / rate
    t = np.longdouble(start) + np.arange(n) / np.longdouble(rate)
    band = 0.75 * rate
    signal = np.sinc(np.asarray(band * (t - tau), np.float64)) * turned(-carrier * tau)
    raw = sarcl.PhaseHistory.from_time(signal, rate=rate, start=start, carrier=carrier, tx=tx, bandwidth=band)
    assert raw.n_samples == 0.75 * n and raw.frequency_step[0] == rate / n
    at, value = focused(raw, spacing=SPEED_OF_LIGHT / rate / 8)
    # a sinc that the record cuts off lacks about 1/(pi^2 band duration) of its energy at the ends of the band
    assert tuple(at) == (4, 4) and abs(value - 1) <= TOLERANCE["gain"]


def dechirped(name, form, sign, points, amplitudes):
    """(samples, arguments of from_time, sweep rate, mixer's reference) of points, in the form that is asked for."""
    carrier, _, _, tx, _ = geometry(name)
    if name == "77 GHz at 10 m":  # FMCW: the sweep that is sent is the reference
        slope, rate, n, reference = sign * 1e13, 10e6, 1000, np.zeros(9)
    else:  # deramp on receive, about a swath 500 m in front of it where samples are real
        slope, rate, n = sign * 28e6 / 37e-6, 24e6, 888
        reference = np.linalg.norm(tx, axis=1) - (500 if form == "real" else 3.7)
    tau = delays(tx, points) - 2 * np.asarray(reference, np.longdouble)[:, None] / C
    start = -n / 2 / rate  # the carrier is that of the sweep's middle
    t = np.longdouble(start) + np.arange(n) / np.longdouble(rate)
    # transmitted phase phi(t) = fc t + K t^2/2; receiver times conjugate reference: phi(t - tau) - phi(t)
    cycles = [-carrier * x + slope * ((t - x) ** 2 - t**2) / 2 for x in np.moveaxis(tau[:, :, None], 1, 0)]
    mixed = sum(a * turned(c) for a, c in zip(amplitudes, cycles, strict=True))
    beat = {"positive": -sign, "negative": sign}.get(form, 0)  # its frequency is -K tau
    signal = mixed.real if form == "real" else mixed if beat > 0 else np.conj(mixed)
    return signal, {
        "rate": rate, "start": start, "carrier": carrier, "tx": tx, "kind": "dechirped", "sweep_rate": slope,
        "beat": None if form == "real" else form, "reference_range": reference,
    }  # fmt: skip


@pytest.mark.parametrize("sign", [1, -1], ids=["rising", "falling"])
@pytest.mark.parametrize("form", ["positive", "negative", "real"])
@pytest.mark.parametrize("name", cases())
def test_dechirped_samples_give_the_echoes_of_the_scene(name, form, sign):
    _, _, _, tx, points = geometry(name)
    if name == "L band at 700 km":
        points = points * 0.02  # 8 m: a video phase of 4e-3 rad at most
    signal, given = dechirped(name, form, sign, points, AMPLITUDES)
    slope, scene = given["sweep_rate"], np.full(9, 10.0) if name == "77 GHz at 10 m" else np.linalg.norm(tx, axis=1)
    raw = sarcl.PhaseHistory.from_time(signal, **given, scene_range=scene)
    assert (
        raw.compressed and (raw.reference_range == scene).all() and raw.frequency_step[0] == abs(slope) / given["rate"]
    )
    tau = delays(tx, points)
    away = tau - 2 * np.asarray(scene, np.longdouble)[:, None] / C
    left = [
        a * np.exp(1j * np.pi * slope * np.asarray(away[:, [k]] ** 2, np.float64)) for k, a in enumerate(AMPLITUDES)
    ]
    law = over_frequency(raw, tau, left)  # of amplitudes with the video phase that is left
    inner = slice(200, -200) if form == "real" else slice(None)
    # a real record is periodic for the FFT, and its negative frequencies leak where it jumps
    assert relative(raw.samples[:, inner], law[:, inner]) <= (0.02 if form == "real" else 1e-7)
    if form != "real":
        moved = sarcl.Scene.points(points, AMPLITUDES)
        n, f = raw.n_samples, raw.frequency[0] + (raw.n_samples - 1) / 2 * raw.frequency_step[0]
        chirp = sarcl.Waveform.chirp(center=f, bandwidth=n * raw.frequency_step[0], duration=1e-6)
        assert np.ptp(raw.frequency) <= 1e-6
        assert relative(raw.samples, echoes(raw, moved, chirp)) <= 0.01
    raw = sarcl.PhaseHistory.from_time(dechirped(name, form, sign, points[:1], [1.0])[0], **given, scene_range=scene)
    at, value = focused(raw, spacing=SPEED_OF_LIGHT / raw.bandwidth[0] / 8)
    assert tuple(at) == (4, 4) and abs(value - 1) <= (0.02 if form == "real" else TOLERANCE["gain"])


@pytest.mark.parametrize("sign", [1, -1], ids=["rising", "falling"])
@pytest.mark.parametrize("form", ["positive", "negative"])
@pytest.mark.parametrize("name", cases())
def test_without_a_range_of_the_scene_a_filter_removes_the_video_phase_at_all_ranges(name, form, sign):
    _, _, _, tx, points = geometry(name)
    for point in points:
        signal, given = dechirped(name, form, sign, point[None], [1.0])
        raw = sarcl.PhaseHistory.from_time(signal, **given)
        assert (raw.reference_range == given["reference_range"]).all()
        law = over_frequency(raw, delays(tx, point[None]), [1.0])
        gain = (raw.samples * law.conj()).mean(axis=1)
        assert np.abs(gain - 1).max() <= 0.1 and np.abs(np.angle(gain)).max() <= 0.05
        middle = slice(raw.n_samples // 2 - 40, raw.n_samples // 2 + 40)
        assert relative(raw.samples[:, middle], law[:, middle]) <= 0.01


@pytest.mark.parametrize("pulse_time", ["start", "middle"])
@pytest.mark.parametrize("name", cases())
def test_raw_chirped_records_compress_to_the_echoes_of_the_scene(name, pulse_time):
    carrier, rate, n, tx, points = geometry(name)
    tau, duration = delays(tx, points), 96 / rate
    width, slope = 14 / rate, -0.3 * rate / duration  # a falling sweep under a Gaussian: no ripples

    def pulse(t):
        t = np.asarray(t, np.float64)
        return np.exp(-np.pi * (t / width) ** 2 / 2 + 1j * np.pi * slope * t**2)

    waveform = sarcl.Waveform.sampled(pulse((np.arange(97) - 48) / rate), rate, carrier)
    late = 0.0 if pulse_time == "middle" else waveform.duration / 2
    start = max(0.0, float(tau[4, 0]) - n / 2 / rate) + 2.2 / rate
    t = np.longdouble(start) + np.arange(n) / np.longdouble(rate)
    signal = sum(a * pulse(t - late - tau[:, [k]]) * turned(-carrier * tau[:, [k]]) for k, a in enumerate(AMPLITUDES))
    raw = sarcl.PhaseHistory.from_time(
        signal, rate=rate, start=start, carrier=carrier, tx=tx, kind="chirped", waveform=waveform, pulse_time=pulse_time
    )
    assert not raw.compressed and raw.n_samples == n + 97
    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    wanted = over_frequency(raw, tau, AMPLITUDES, waveform.pulse_spectrum(f))
    assert relative(raw.samples, wanted) <= 1e-5  # the tails of the pulse, cut off at exp(-18)
    made = sarcl.compress(raw)
    assert relative(made.samples, echoes(made, sarcl.Scene.points(points, AMPLITUDES), waveform)) <= 1e-5


@pytest.mark.parametrize("down", [False, True])
def test_a_rectangular_chirp_compresses_to_gain_1_and_the_wrong_sign_is_warned_of(down):
    carrier, rate, n, tx, points = geometry("L band at 700 km")
    n, band, duration = 4096, 28e6, 32e-6
    waveform = sarcl.Waveform.chirp(center=carrier, bandwidth=band, duration=duration, down=down)
    assert waveform.sweep_rate == (-1 if down else 1) * band / duration
    tau = delays(tx, points[:1])
    start = float(tau.mean()) - 1500 / rate
    t = np.longdouble(start) + np.arange(n) / np.longdouble(rate)
    since = np.asarray(t - tau - duration / 2, np.float64)  # from the middle of the pulse
    signal = (
        (np.abs(since) <= duration / 2) * np.exp(1j * np.pi * waveform.sweep_rate * since**2) * turned(-carrier * tau)
    )
    made = {}
    for sent in (down, not down):
        other = sarcl.Waveform.chirp(center=carrier, bandwidth=band, duration=duration, down=sent)
        made[sent] = sarcl.PhaseHistory.from_time(signal, rate=rate, start=start, tx=tx, kind="chirped", waveform=other)
    good = sarcl.compress(made[down])
    wanted = over_frequency(good, tau, [1.0])
    assert relative(good.samples, wanted) ** 2 <= TOLERANCE["chirp"]
    at, value = focused(good, spacing=SPEED_OF_LIGHT / rate / 8)
    assert tuple(at) == (4, 4) and abs(value - 1) <= 2e-3  # without the pulse's loss outside the band: 0.993
    with pytest.warns(sarcl.SarclWarning, match=rf"contrast .* with a chirp of the other sign.*down={down}\)"):
        sarcl.compress(made[not down])
    fog = sarcl.Waveform.chirp(center=carrier, bandwidth=band, duration=duration * 4)
    with pytest.warns(sarcl.SarclWarning, match="contrast"):
        sarcl.compress(made[down], fog)


@pytest.mark.parametrize("down", [False, True])
@pytest.mark.parametrize("product", [100, 1000, 10000])
def test_what_a_chirp_loses_outside_its_band_is_made_up_for_by_the_closed_form(product, down):
    """A record of one sample has the spectrum 1/rate: that of a chirp in the band, sqrt(T/B) exp(j pi/4), and the part
    of the amplitude that stays in the band, 1 - (1 + j)/(pi sqrt(2 T B)), are what it is divided by."""
    rate, carrier, n, band = 32e6, 1e9, 65, 20e6
    duration = product / band
    chirp = sarcl.Waveform.chirp(center=carrier, bandwidth=band, duration=duration, down=down)
    time = np.longdouble(1e-3) + 20 / np.longdouble(rate)
    tau = np.reshape(time - np.longdouble(duration) / 2, (1, 1))  # of an echo in the middle of which the sample lies
    record = np.zeros((1, n), np.complex128)
    record[0, 20] = turned(-carrier * tau)[0, 0]
    raw = sarcl.PhaseHistory.from_time(
        record, rate=rate, start=1e-3, carrier=carrier, tx=np.zeros((1, 3)), kind="chirped", waveform=chirp
    )
    stationary = np.sqrt(duration / band) * np.exp(0.25j * np.pi * (-1 if down else 1))
    share = over_frequency(raw, tau, [1.0]) / (raw.samples * rate * stationary)
    lost = (1 - 1j if down else 1 + 1j) / (np.pi * np.sqrt(2 * product))
    assert np.abs(share - (1 - lost)).max() <= 0.05 / product


@pytest.mark.parametrize("product", [100, 1000, 10000])
def test_the_gain_of_a_rectangular_chirp_is_1(product):
    """Without what it loses outside its band the peak is 3 % less for T B = 100."""
    carrier, _, _, tx, points = geometry("L band at 700 km")
    band, rate, duration = 20e6, 160e6, product / 20e6
    chirp = sarcl.Waveform.chirp(center=carrier, bandwidth=band, duration=duration)
    tau = delays(tx, points[:1])
    start = float(tau.min()) - 0.05 * duration - 1e-6
    t = np.longdouble(start) + np.arange(int(rate * (1.1 * duration + 2e-6 + np.ptp(tau)))) / np.longdouble(rate)
    since = np.asarray(t - tau - duration / 2, np.float64)
    signal = (np.abs(since) <= duration / 2) * np.exp(1j * np.pi * chirp.sweep_rate * since**2) * turned(-carrier * tau)
    raw = sarcl.PhaseHistory.from_time(signal, rate=rate, start=start, tx=tx, kind="chirped", waveform=chirp)
    raw = sarcl.compress(raw)
    peak = (raw.samples / over_frequency(raw, tau, [1.0])).mean(axis=1)
    assert np.abs(peak - 1).max() <= 0.1 * np.sqrt(2) / (np.pi * np.sqrt(2 * product))


def test_noise_and_clutter_compress_without_a_warning():
    random = np.random.default_rng(1)
    chirp = sarcl.Waveform.chirp(center=1e9, bandwidth=28e6, duration=32e-6)
    noise = random.standard_normal((16, 2048, 2)) @ (1, 1j)
    raw = sarcl.PhaseHistory.from_time(
        noise, rate=32e6, start=1e-3, carrier=1e9, tx=np.zeros((16, 3)), kind="chirped", waveform=chirp
    )
    assert sarcl.compress(raw).compressed


def test_a_beat_of_the_wrong_sign_is_warned_of():
    carrier, _, _, tx, points = geometry("77 GHz at 10 m")
    t = np.arange(1000) / 10e6
    signal = np.exp(2j * np.pi * 1e13 * t * np.float64(delays(tx, points[:1])))
    given = dict(rate=10e6, carrier=carrier, tx=tx, kind="dechirped", sweep_rate=1e13)
    sarcl.PhaseHistory.from_time(signal, beat="positive", **given)
    with pytest.warns(sarcl.SarclWarning, match=r"energy lies at negative ranges.*give beat='positive'"):
        sarcl.PhaseHistory.from_time(signal, beat="negative", **given)


def test_the_type_of_the_samples_is_kept_and_files_are_read_by_rows(tmp_path):
    given = dict(rate=1e6, carrier=1e9, tx=np.zeros((3, 3)))
    for dtype, kind, wanted in (
        ("c8", {}, np.complex64), ("c16", {}, np.complex128),
        ("f4", {"kind": "dechirped", "sweep_rate": 1e9}, np.complex64),
        ("i2", {"kind": "dechirped", "sweep_rate": 1e9}, np.complex64),
        ("f8", {"kind": "dechirped", "sweep_rate": 1e9}, np.complex128),
    ):  # fmt: skip
        values = np.arange(1, 25).reshape(3, 8).astype(dtype)
        stored = np.lib.format.open_memmap(tmp_path / "a.npy", "w+", values.dtype, values.shape)
        stored[:] = values
        made = sarcl.PhaseHistory.from_time(stored, **given, **kind)
        assert made.samples.dtype == wanted and not made.samples.flags.writeable
        assert (made.samples == sarcl.PhaseHistory.from_time(values, **given, **kind).samples).all()


BAD = {
    "kind": ({"kind": "raw"}, "kind is 'raw'; choose one of 'compressed', 'dechirped', 'chirped', 'rf'"),
    "one row": ({"samples": np.ones(8)}, r"samples has shape \(8,\), wanted \(n_rows, n_times\)"),
    "real": ({"samples": np.ones((3, 8))}, "compressed samples must be complex, got float64; real samples"),
    "no carrier": ({"carrier": None}, "no waveform to take it from; give carrier="),
    "starts": ({"start": [0.0, 1.0]}, r"start has shape \(2,\), wanted one number or one per row, \(3,\)"),
    "band": ({"bandwidth": 2e6}, "bandwidth is 2e\\+06 Hz, but samples at 1e\\+06 Hz hold no more"),
    "beat of pulses": ({"beat": "positive"}, "compressed samples have no beat; leave it out"),
    "sweep of pulses": ({"sweep_rate": 1e9}, "sweep_rate is for dechirped samples, and kind is 'compressed'"),
    "reference": ({"reference_range": 5.0}, "reference_range is for dechirped samples"),
    "no sweep": ({"kind": "dechirped"}, "dechirped samples need sweep_rate="),
    "no beat": (
        {"kind": "dechirped", "sweep_rate": 1e9},
        'complex dechirped samples need beat="positive" or "negative"',
    ),
    "no pulse": ({"kind": "chirped"}, "chirped samples need waveform="),
    "other carrier": (
        {"waveform": sarcl.Waveform.chirp(center=2e9, bandwidth=1e6, duration=1e-6)},
        "carrier is 1e\\+09 Hz but waveform.center 2e\\+09 Hz; they must be one frequency",
    ),
    "not finite": ({"samples": np.full((3, 8), np.nan + 0j)}, r"samples\[0, 0\] is .*nan"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_a_kind_does_not_have_is_refused(name):
    given, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        sarcl.PhaseHistory.from_time(
            **{"samples": np.ones((3, 8), complex), "rate": 1e6, "carrier": 1e9, "tx": np.zeros((3, 3)), **given}
        )
