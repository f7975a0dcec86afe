"""Phase histories: rows and their fields, samples that stay in files, time signals, and what is refused."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace

import h5py
import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.model.phase_history import PER_ROW

TOLERANCE = {
    "time signal": 1e-12,  # float64 FFT against the float64 sum, relative to the largest value
}


def noise(n_rows=6, n_samples=5, dtype=np.complex64, seed=0):
    random = np.random.default_rng(seed)
    s = random.standard_normal((n_rows, n_samples)) + 1j * random.standard_normal((n_rows, n_samples))
    return s.astype(dtype)


def history(samples=None, **changed):
    samples = noise() if samples is None else samples
    shape = (len(samples),) if isinstance(samples, list) else samples.shape
    n = shape[0] if shape else 1
    fields = {
        "frequency": 9e9,
        "frequency_step": 1e6,
        "tx": np.stack([np.full(n, 1e4), np.arange(n), np.zeros(n)], axis=1),
        "reference_range": 1e4,
    }
    return sarcl.PhaseHistory(samples, **{**fields, **changed})


def full(n=6, **changed):
    """Every optional field, all different from row to row."""
    i = np.arange(n)
    v = np.stack([i, i, i], axis=1) * 1.0
    return history(
        noise(n),
        rx=v + 5,
        time=i * 0.1,
        tx_channel=i // 2,
        rx_channel=i % 3,
        polarization=np.array(["HH", "HV"])[i % 2],
        weight=i + 1,
        tx_velocity=v + 1,
        rx_velocity=v + 2,
        **changed,
    )


# fields


def test_one_value_serves_all_rows():
    raw = history(weight=0.5, time=3, rx_channel=2, polarization="HV", tx_channel=1)
    for name in ("frequency", "frequency_step", "reference_range", "weight", "time", "rx_channel", "polarization"):
        assert getattr(raw, name).shape == (6,) and len(set(getattr(raw, name).tolist())) == 1


def test_the_receiver_is_where_the_transmitter_is_unless_given():
    raw = history()
    assert raw.rx is raw.tx and raw.is_monostatic
    assert history(rx=raw.tx.copy()).is_monostatic
    assert not history(rx=raw.tx + 1).is_monostatic


def test_band_center_and_swath_follow_from_the_frequencies():
    raw = history(noise(2, 5), frequency=[9e9, 8e9], frequency_step=[1e6, 2e6])
    assert (raw.bandwidth == [5e6, 10e6]).all()
    assert (raw.center_frequency == [9.002e9, 8.004e9]).all()
    assert (raw.swath == SPEED_OF_LIGHT / np.array([2e6, 4e6])).all()


def test_words_may_come_as_files_hold_them():
    for words in (np.array([b"HH", b"HV"] * 3), np.array(["HH", "HV"] * 3, object), ["HH", "HV"] * 3):
        assert history(polarization=words).select(polarization="HV").n_rows == 3


@pytest.mark.parametrize("dtype", [np.complex64, np.complex128])
def test_complex_samples_keep_their_precision(dtype):
    assert history(noise(dtype=dtype)).read(0, 6).dtype == dtype


@pytest.mark.parametrize("given", [[[1, 2], [3, 4]], np.array([[1, 2], [3, 4]]), np.array([[1, 2], [3, 4]], "f4")])
def test_real_samples_become_complex128(given):
    raw = history(given)
    assert raw.samples.dtype == np.complex128 and (raw.samples == [[1, 2], [3, 4]]).all()


def test_any_memory_layout_makes_the_same_samples():
    s = noise()
    for given in (
        np.asfortranarray(s),
        s[::-1, ::-1].copy()[::-1, ::-1],
        s.astype(">c8"),
        np.repeat(s, 2, axis=0)[::2],
    ):
        block = history(given).read(1, 4)
        assert (block == s[1:4]).all() and block.dtype.isnative


def test_the_callers_arrays_are_neither_frozen_nor_followed():
    samples, frequency, tx, weight = noise(), np.full(6, 9e9), np.ones((6, 3)), np.ones(6)
    raw = history(samples, frequency=frequency, tx=tx, weight=weight)
    before = samples.copy()
    for array in (samples, frequency, tx, weight):
        array *= 2
    assert (raw.samples == before).all() and (raw.frequency == 9e9).all()
    assert (raw.tx == 1).all() and (raw.weight == 1).all()
    for array in (raw.samples, raw.frequency, raw.tx, raw.weight):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_an_array_that_is_read_only_is_taken_without_a_copy():
    samples = noise()
    samples.flags.writeable = False
    assert history(samples).samples is samples


# rows


ROWS = {
    "slice": slice(1, 4),
    "step": slice(None, None, 2),
    "backwards": slice(None, None, -1),
    "one": 2,
    "last": -1,
    "list": [4, 0, 0, 3],
    "mask": np.array([True, False, True, True, False, False]),
    "all": slice(None),
}


@pytest.mark.parametrize("name", ROWS)
def test_chosen_rows_bring_all_their_fields(name):
    raw = full()
    part = raw[ROWS[name]]
    index = np.atleast_1d(np.arange(6)[ROWS[name]])
    assert (part.read(0, part.n_rows) == raw.samples[index]).all()
    for field in ("frequency", "frequency_step", "tx", "rx", "reference_range", *PER_ROW):
        assert (getattr(part, field) == getattr(raw, field)[index]).all()


def test_chosen_rows_keep_waveform_and_state():
    wave = sarcl.Waveform.chirp(center=9e9, bandwidth=5e6, duration=1e-6)
    part = history(waveform=wave, compressed=False)[1:]
    assert part.waveform is wave and not part.compressed and part.rx is part.tx


def test_select_takes_a_polarisation_a_channel_or_both():
    raw = full()
    assert (raw.select(polarization="HV").time == raw.time[1::2]).all()
    assert (raw.select(channel=2).time == raw.time[2::3]).all()
    assert (raw.select(polarization="HV", channel=2).time == raw.time[5:]).all()
    assert raw.select().n_rows == 6


SELECTIONS = {
    "polarisation": ({"polarization": "VV"}, r"polarization 'VV' is not in these data; there are \['HH', 'HV'\]"),
    "channel": ({"channel": 7}, r"channel 7 is not in these data; there are \[0, 1, 2\]"),
}


@pytest.mark.parametrize("name", SELECTIONS)
def test_select_lists_what_there_is(name):
    options, message = SELECTIONS[name]
    with pytest.raises(ValueError, match=message):
        full().select(**options)


def test_select_lists_what_is_left_of_a_polarisation():
    raw = full(4)  # channels 0 1 2 0, polarisations HH HV HH HV
    with pytest.raises(ValueError, match=r"channel 2 is not in the rows of polarization 'HV'; there are \[0, 1\]"):
        raw.select(polarization="HV", channel=2)


def test_select_says_when_the_rows_have_no_such_field():
    with pytest.raises(ValueError, match="these data name no polarization"):
        history().select(polarization="HH")
    with pytest.raises(ValueError, match="these data name no channel"):
        history().select(channel=0)


def test_choosing_no_row_or_one_that_is_not_there_raises():
    with pytest.raises(ValueError, match="no row is left of 6; choose at least one"):
        history()[6:]
    for rows in (6, [0, 9], np.zeros((2, 2), int), np.ones(5, bool), 1.5):
        with pytest.raises(IndexError):
            history()[rows]


# lazy samples


class Source:
    """Rows on demand, and a note of what was asked for."""

    def __init__(self, samples):
        self.samples, self.shape, self.dtype, self.asked = samples, samples.shape, samples.dtype, []

    def __getitem__(self, rows):
        assert isinstance(rows, slice) and rows.step in (None, 1)
        self.asked.append((rows.start, rows.stop))
        return self.samples[rows]


@pytest.fixture(params=["memmap", "hdf5", "object", "big-endian memmap"])
def lazy(request, tmp_path):
    """(a phase history whose samples are not in memory, the same samples in memory)"""
    s = noise(20)
    if request.param == "hdf5":
        with h5py.File(tmp_path / "s.h5", "w") as file:
            yield history(file.create_dataset("samples", data=s)), s
    elif request.param == "object":
        yield history(Source(s)), s
    else:
        dtype = ">c8" if request.param.startswith("big") else "c8"
        s.astype(dtype).tofile(tmp_path / "s.dat")
        yield history(np.memmap(tmp_path / "s.dat", dtype, "r", shape=s.shape)), s


def is_in_memory(samples):
    return isinstance(samples, np.ndarray) and not isinstance(samples, np.memmap)


def test_lazy_samples_are_read_in_rows_and_in_native_order(lazy):
    raw, s = lazy
    block = raw.read(3, 9)
    assert (block == s[3:9]).all() and block.dtype == np.complex64 and block.dtype.isnative


@pytest.mark.parametrize(
    "rows", [slice(2, 9), slice(None, None, -3), [7, 7, 1, 2, 3], np.arange(20) % 3 == 0], ids=repr
)
def test_chosen_rows_of_lazy_samples_stay_lazy(lazy, rows):
    raw, s = lazy
    part = raw[rows]
    assert not is_in_memory(part.samples)
    assert (part.read(0, part.n_rows) == s[rows]).all()
    again = part[::-1][1:]
    assert not is_in_memory(again.samples)
    assert (again.read(0, again.n_rows) == s[rows][::-1][1:]).all()


def test_selected_rows_of_lazy_samples_stay_lazy(lazy):
    raw, s = lazy
    part = replace(raw, polarization=["HH", "HV"] * 10).select(polarization="HV")
    assert not is_in_memory(part.samples) and (part.read(2, 5) == s[[5, 7, 9]]).all()


def test_a_slice_reads_only_its_rows():
    source = Source(noise(20))
    raw = history(source)
    part = raw[5:15]
    assert source.asked == []  # nothing is read before it is asked for
    raw.read(1, 3)
    part.read(2, 4)
    raw[[3, 4, 5, 9]].read(0, 4)
    assert source.asked == [(1, 3), (7, 9), (3, 6), (9, 10)]


def test_reading_names_the_first_nan_by_its_row_in_the_whole(tmp_path):
    s = noise(20)
    s[7, 3] = np.nan
    s[8, 0] = np.inf
    raw = history(Source(s))
    assert raw.read(0, 7).shape == (7, 5)
    with pytest.raises(ValueError, match=r"samples\[7, 3\] is .*nan.*every value must be finite"):
        raw.read(6, 10)


def test_reading_past_the_end_raises():
    for start, stop in ((0, 7), (-1, 3), (4, 2)):
        with pytest.raises(IndexError, match="there are 6"):
            history().read(start, stop)


def test_a_source_that_returns_too_few_rows_is_refused():
    source = Source(noise(20))
    source.shape = (30, 5)
    with pytest.raises(ValueError, match=r"samples\[15:25\] gave shape \(5, 5\), wanted \(10, 5\)"):
        history(source).read(15, 25)


# concatenate


def test_concatenating_the_pieces_gives_the_whole():
    raw = full()
    whole = sarcl.concatenate([raw[:2], raw[2:3], raw[3:]])
    assert (whole.samples == raw.samples).all()
    for field in ("frequency", "frequency_step", "tx", "rx", "reference_range", *PER_ROW):
        assert (getattr(whole, field) == getattr(raw, field)).all()


def test_a_field_that_one_part_lacks_is_left_out():
    whole = sarcl.concatenate([history(weight=1, time=0), history(time=2)])
    assert whole.weight is None and (whole.time == [0] * 6 + [2] * 6).all()


def test_concatenating_keeps_what_is_monostatic_so_and_mixes_with_what_is_not():
    one, two = history(), history(rx=np.ones((6, 3)))
    both = sarcl.concatenate([one, one])
    assert both.rx is both.tx
    assert (sarcl.concatenate([one, two]).rx == np.concatenate([one.tx, two.rx])).all()


def test_concatenating_precisions_keeps_the_higher():
    whole = sarcl.concatenate([history(), history(noise(dtype=np.complex128))])
    assert whole.samples.dtype == np.complex128


def test_equal_waveforms_are_kept_and_different_ones_dropped():
    def wave(duration):
        return sarcl.Waveform.chirp(center=9e9, bandwidth=5e6, duration=duration)

    assert sarcl.concatenate([history(waveform=wave(1e-6)), history(waveform=wave(1e-6))]).waveform is not None
    assert sarcl.concatenate([history(waveform=wave(1e-6)), history(waveform=wave(2e-6))]).waveform is None
    assert sarcl.concatenate([history(waveform=wave(1e-6)), history()]).waveform is None
    with pytest.raises(ValueError, match="different waveforms; call compress on each first"):
        sarcl.concatenate([history(waveform=wave(t), compressed=False) for t in (1e-6, 2e-6)])


def test_lazy_samples_stay_lazy_when_concatenated(lazy):
    raw, s = lazy
    whole = sarcl.concatenate([raw[3:], history(), raw[:3]])
    wanted = np.concatenate([s[3:], noise(), s[:3]])
    assert not is_in_memory(whole.samples)
    assert (whole.read(0, 26) == wanted).all() and (whole.read(15, 25) == wanted[15:25]).all()
    assert (np.asarray(whole.samples) == wanted).all()
    assert (whole[[25, 0, 18]].read(0, 3) == wanted[[25, 0, 18]]).all()


# time signal


def direct_sum(raw, delay):
    """s~_p(t) = sum_n s_p(f_n) exp(+j 2 pi (f_n - fc) t), fc the frequency of sample n_samples//2."""
    n = np.arange(raw.n_samples) - raw.n_samples // 2
    delay = np.broadcast_to(delay, (raw.n_rows, np.shape(delay)[-1]))
    turns = (raw.frequency_step[:, None] * delay)[:, :, None] * n
    return (raw.samples[:, None] * np.exp(2j * np.pi * turns)).sum(axis=-1)


@pytest.mark.parametrize("oversample", [1, 2, 3])
@pytest.mark.parametrize("n_samples", [1, 2, 7, 8])
@pytest.mark.parametrize("step", [1e6, [1e6, 2e6, 3e6]], ids=["one step", "steps by row"])
def test_time_signal_is_the_direct_sum(step, n_samples, oversample):
    raw = history(noise(3, n_samples), frequency_step=step)
    delay, signal = raw.time_signal(oversample)
    n = n_samples * oversample
    assert signal.shape == (3, n) and delay.shape == ((n,) if np.ndim(step) == 0 else (3, n))
    wanted = direct_sum(raw, delay)
    assert np.abs(signal - wanted).max() <= TOLERANCE["time signal"] * np.abs(wanted).max()


def test_time_signal_covers_the_unambiguous_delay_about_zero():
    delay, _ = history(noise(2, 8)).time_signal(4)
    assert delay[16] == 0 and delay[0] == -0.5e-6
    assert np.diff(delay) == pytest.approx(1e-6 / 32)


def test_a_point_peaks_at_its_delay():
    raw = history(np.ones((1, 64)))
    late = 10 / raw.bandwidth[0]
    f = raw.frequency[0] + raw.frequency_step[0] * np.arange(64)
    delay, signal = history(np.exp(-2j * np.pi * f * late)[None]).time_signal()
    assert delay[np.abs(signal[0]).argmax()] == pytest.approx(late)
    assert np.abs(signal).max() == pytest.approx(64)


# the smallest, and what is refused


def test_one_row_of_one_sample_works():
    raw = history(np.array([[2 + 1j]]))
    delay, signal = raw.time_signal()
    assert delay.tolist() == [0] and signal.tolist() == [[2 + 1j]]
    assert raw[0].n_rows == 1 and sarcl.concatenate([raw, raw]).n_rows == 2
    assert (raw.center_frequency == raw.frequency).all()


def test_a_phase_history_travels_to_other_processes_with_its_report():
    report = sarcl.Report(plan={"taps": 4}, tolerance=1e-3, seconds={"echo": 0.1}, device="a device", seed=3)
    raw = full(report=report, waveform=sarcl.Waveform.sampled([1, 2j], 1e8, 9e9))
    for again in (pickle.loads(pickle.dumps(raw)), copy.deepcopy(raw)):
        assert (again.samples == raw.samples).all() and (again.polarization == raw.polarization).all()
        assert again.report.to_dict() == report.to_dict() and (again.waveform.signal == [1, 2j]).all()
        with pytest.raises(TypeError):
            again.report.plan["taps"] = 5


def test_rows_and_fields_that_disagree_are_both_counted():
    message = r"^samples has 700 rows but tx has 720; give one tx per row$"
    with pytest.raises(ValueError, match=message):
        sarcl.PhaseHistory(
            np.ones((700, 2), complex), frequency=1e9, frequency_step=1e6, tx=np.zeros((720, 3)), reference_range=1
        )


def ragged(*lengths):
    return [[1] * n for n in lengths]


BAD = {
    "samples of one axis": ({"samples": np.ones(5, complex)}, r"samples has shape \(5,\), wanted \(n_rows, n_samp"),
    "samples of no axis": ({"samples": np.array(1j)}, r"samples has shape \(\), wanted"),
    "no rows": ({"samples": np.ones((0, 5), complex)}, r"samples has shape \(0, 5\), wanted .* neither zero"),
    "no samples": ({"samples": np.ones((5, 0), complex)}, r"samples has shape \(5, 0\)"),
    "ragged samples": ({"samples": ragged(2, 1)}, "samples is .*, whose rows differ in length; give rows"),
    "samples of truths": ({"samples": np.ones((6, 5), bool)}, "samples has type bool, wanted complex64 or complex128"),
    "samples of words": ({"samples": [["a", "b"]]}, "samples must be numbers"),
    "samples too long": ({"samples": np.ones((6, 5), np.clongdouble)}, "samples has type complex256, wanted complex64"),
    "samples not finite": ({"samples": np.array([[1, 2j], [3, np.nan]])}, r"samples\[1, 1\] is"),
    "rx of other length": ({"rx": np.zeros((4, 3))}, "samples has 6 rows but rx has 4; give one rx per row"),
    "time of other length": ({"time": [1, 2]}, "samples has 6 rows but time has 2; give one time per row"),
    "tx turned": ({"tx": np.zeros((3, 6))}, r"tx has shape \(3, 6\), wanted \(6, 3\)"),
    "one tx": ({"tx": (1, 2, 3)}, r"tx has shape \(3,\), wanted \(6, 3\)"),
    "tx not finite": ({"tx": [[0, 0, 0]] * 4 + [[0, np.nan, 0]] * 2}, r"tx\[4, 1\] is nan"),
    "complex tx": ({"tx": np.ones((6, 3)) + 1j}, "tx must be numbers that fit float64"),
    "no frequency": ({"frequency": None}, "frequency must be numbers"),
    "frequency of one row": ({"frequency": [9e9]}, "samples has 6 rows but frequency has 1"),
    "frequency zero": ({"frequency": 0}, r"frequency\[0\] is 0 Hz; it must be positive"),
    "frequency a word": ({"frequency": "9e9"}, "frequency must be numbers"),
    "falling sweep": (
        {"frequency_step": -1e6},
        r"frequency_step\[0\] is -1e\+06 Hz; it must be positive: reverse the samples",
    ),
    "one falling sweep": ({"frequency_step": [1, 1, 1, -2, 1, 1]}, r"frequency_step\[3\] is -2 Hz"),
    "range not finite": ({"reference_range": [1, 1, np.inf, 1, 1, 1]}, r"reference_range\[2\] is inf"),
    "half a channel": ({"rx_channel": [0, 1, 2, 3, 4, 0.5]}, "rx_channel must be numbers that fit int64"),
    "channel not finite": ({"tx_channel": [np.nan] * 6}, "tx_channel must be numbers that fit int64"),
    "polarisation a number": ({"polarization": 3}, "polarization must be strings such as 'HH'"),
    "polarisations of other length": ({"polarization": ["HH"] * 5}, "samples has 6 rows but polarization has 5"),
    "negative weight": ({"weight": [1, 1, -3, 1, 1, 1]}, r"weight\[2\] is -3; it cannot be negative"),
    "weight not finite": ({"weight": np.nan}, r"weight\[0\] is nan"),
    "one velocity": ({"tx_velocity": (1, 2, 3)}, r"tx_velocity has shape \(3,\), wanted \(6, 3\)"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_data_say_what_was_wanted(name):
    changed, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        history(**changed)


def test_bad_parts_are_named():
    raw = history()
    for parts, kind, message in (
        ([], ValueError, "no phase history; give at least one"),
        ([raw, history(noise(6, 4))], ValueError, "part 1 has 4 samples per row, part 0 has 5"),
        ([raw, history(compressed=False)], ValueError, "part 1 and part 0 differ: one is compressed"),
        ([raw, 3], TypeError, "part 1 is a int; concatenate joins phase histories"),
        (raw, TypeError, r"give \[raw, \.\.\.\]"),
    ):
        with pytest.raises(kind, match=message):
            sarcl.concatenate(parts)


def test_other_bad_arguments():
    with pytest.raises(TypeError, match=r"waveform is a str; give a sarcl\.Waveform or None"):
        history(waveform="chirp")
    with pytest.raises(ValueError, match="oversample is 0; it must be at least 1"):
        history().time_signal(0)
    with pytest.raises(TypeError, match="frequency_stop"):
        history(frequency_stop=1)


def test_selecting_what_one_element_sent():
    raw = history(
        np.ones((6, 4), complex), tx_channel=[0, 1, 2, 0, 1, 2], rx_channel=[0, 0, 0, 1, 1, 1], time=np.arange(6.0)
    )
    assert (raw.select(sender=1).time == raw.time[1::3]).all()
    assert (raw.select(sender=1, channel=1).time == raw.time[4:5]).all()
    with pytest.raises(ValueError, match=r"sender 5 is not in these data; there are \[0, 1, 2\]"):
        raw.select(sender=5)


def test_an_axis_of_frequencies_is_not_taken_for_one_frequency_per_row():
    axis = 9e9 + 1e6 * np.arange(8)
    for n_rows in (5, 8):
        given = {"samples": np.ones((n_rows, 8), complex), "tx": np.ones((n_rows, 3)), "reference_range": 10.0}
        with pytest.raises(ValueError, match=r"frequency has 8 values, one per sample: .*give frequency=f\[0\]"):
            sarcl.PhaseHistory(frequency=axis, frequency_step=1e6, **given)
        assert (sarcl.PhaseHistory(frequency=axis[0], frequency_step=1e6, **given).frequency == axis[0]).all()
    for rows in (9e9 + 20e6 * np.arange(8), 9e9 * np.ones(8), axis[::-1]):  # stepped carriers, one carrier, falling
        assert (sarcl.PhaseHistory(frequency=rows, frequency_step=1e6, **given).frequency == rows).all()
    meant = sarcl.PhaseHistory(frequency=axis, frequency_step=1e6, tx_channel=np.arange(8), **given)
    assert (meant[2:].frequency == axis[2:]).all() and (meant[:].frequency == axis).all()


def test_data_of_one_antenna_stay_so_when_it_is_moved():
    raw = sarcl.PhaseHistory(np.ones((4, 8), complex), 9e9, 1e6, np.arange(12.0).reshape(4, 3), 10.0)
    for made in (raw, raw[1:], pickle.loads(pickle.dumps(raw)), sarcl.concatenate([raw, raw])):
        moved = replace(made, tx=made.tx + 0.1)
        assert moved.rx is moved.tx and moved.is_monostatic and (moved.rx == made.tx + 0.1).all()
        again = replace(moved, weight=1.0)
        assert again.rx is again.tx
    apart = replace(raw, rx=raw.tx + 5)
    assert not apart.is_monostatic and not replace(apart, tx=raw.tx + 0.1).is_monostatic
    assert (replace(apart, tx=raw.tx + 0.1).rx == raw.tx + 5).all()
    assert (replace(raw, tx=raw.tx + 0.1, rx=raw.rx.copy()).rx == raw.tx).all()  # a receiver that stays
    assert replace(apart, rx=None).is_monostatic
    assert (sarcl.PhaseHistory(np.ones((4, 8), complex), 9e9, 1e6, raw.tx + 1, 10.0, rx=raw.tx).rx == raw.tx).all()
