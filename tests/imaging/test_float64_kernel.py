"""The parts of float64 backprojection, one by one: pairs, sine and cosine, taps, FFT, formulas."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal, getcontext

import numpy as np
import pytest
from helpers.cases import noise_history

from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.imaging.float64.direct import packed
from sarcl.imaging.focusing_task import geometry_of
from sarcl.numerics import error_bounds, interpolation, interpolator_choice
from sarcl.opencl import fft, programs
from sarcl.reference.interp import interpolate

# name -> (expression in pairs, twin in Decimal, error bound relative to the result)
PAIRS = {
    "sum": ("pair_add(a, b)", lambda a, b: a + b, Decimal(3) * Decimal(2) ** -106),
    "product": ("pair_mul(a, b)", lambda a, b: a * b, Decimal(5) * Decimal(2) ** -106),
    "square root": ("pair_sqrt(a)", lambda a, b: a.sqrt(), Decimal(5) * Decimal(2) ** -106),
}


def probe(device, monkeypatch, body, inputs, n_out, header="doubledouble.clh", **macros):
    """Run `body` on VW lanes of every input at once; returns (n_out, n) float64."""
    lanes = device.info.vector_width
    n = -(-inputs.shape[1] // lanes) * lanes
    padded = np.ones((len(inputs), n))
    padded[:, : inputs.shape[1]] = inputs
    expanded = programs.source.__wrapped__
    text = "\n".join(expanded(h) for h in dict.fromkeys(["doubledouble.clh", header])) + (
        "\n__kernel void probe(__global const double *x, __global const double *table, int n, __global double *out) {\n"
        f"    int i = get_global_id(0);\n    {body}\n}}\n"
    )
    monkeypatch.setattr("sarcl.opencl.device.source", lambda file: text if file == "probe.cl" else expanded(file))
    table = macros.pop("table", np.zeros(1))
    built = device._build("probe.cl", {"VW": lanes, "FP64": 1, **macros})["probe"]
    out = device.zeros(8 * n_out * n)
    source, weights = device.upload(padded), device.upload(table)
    device.run(built, (n // lanes,), None, source, weights, n, out)
    return device.download(out, np.empty((n_out, n)))[:, : inputs.shape[1]]


def pairs(random, n):
    """Numbers over many magnitudes as hi and lo parts, and their exact sums."""
    hi = random.uniform(1, 2, n) * 10.0 ** random.integers(-3, 12, n)
    lo = hi * random.uniform(-1, 1, n) * 2.0**-54
    return hi, lo, [Decimal(float(a)) + Decimal(float(b)) for a, b in zip(hi, lo, strict=True)]


@pytest.mark.parametrize("name", PAIRS)
def test_pairs_keep_their_error_bound(double, monkeypatch, name):
    getcontext().prec = 60
    expression, twin, bound = PAIRS[name]
    random = np.random.default_rng(1)
    (a, a_low, exact_a), (b, b_low, exact_b) = pairs(random, 801), pairs(random, 801)
    body = (
        "pair a = make_pair(LOAD(i, x), LOAD(i, x + n)), b = make_pair(LOAD(i, x + 2 * n), LOAD(i, x + 3 * n));"
        f"pair r = {expression}; STORE(r.hi, i, out); STORE(r.lo, i, out + n);"
    )
    hi, lo = probe(double, monkeypatch, body, np.stack([a, a_low, b, b_low]), 2)
    for got, rest, p, q in zip(hi, lo, exact_a, exact_b, strict=True):
        wanted = twin(p, q)
        assert abs(Decimal(float(got)) + Decimal(float(rest)) - wanted) <= bound * wanted


def test_square_root_of_a_zero_pair_is_zero(double, monkeypatch):
    body = "pair r = pair_sqrt(make_pair(LOAD(i, x), (dv)0)); STORE(r.hi, i, out); STORE(r.lo, i, out + n);"
    assert not probe(double, monkeypatch, body, np.zeros((1, 8)), 2).any()


def test_a_pair_splits_into_the_nearest_integer_and_the_rest(double, monkeypatch):
    random = np.random.default_rng(2)
    hi = random.uniform(-1, 1, 2001) * 10.0 ** random.uniform(-2, 14, 2001)
    hi[:100] = np.rint(hi[:100]) + 0.5
    lo = hi * random.uniform(-1, 1, 2001) * 2.0**-54
    body = (
        "dv k; dv rest = pair_split(make_pair(LOAD(i, x), LOAD(i, x + n)), &k);"
        "STORE(k, i, out); STORE(rest, i, out + n);"
    )
    whole, rest = probe(double, monkeypatch, body, np.stack([hi, lo]), 2)
    assert (whole == np.rint(whole)).all() and (abs(rest) <= 0.5).all()
    wide = np.longdouble
    assert (abs((hi - whole.astype(wide)) + lo - rest) <= 2.0**-53).all()


def test_sine_and_cosine_of_turns_err_less_than_4e_15(double, monkeypatch):
    turns = np.linspace(-0.5, 0.5, 20001)
    body = "dv s, c; sincos_double(LOAD(i, x), &s, &c); STORE(s, i, out); STORE(c, i, out + n);"
    sine, cosine = probe(double, monkeypatch, body, turns[None], 2)
    angle = 2 * np.pi * turns.astype(np.longdouble)
    angle += 2 * np.longdouble(1.2246467991473532e-16) * turns  # what float64 leaves of pi
    assert abs(sine - np.sin(angle)).max() < 4e-15
    assert abs(cosine - np.cos(angle)).max() < 4e-15


@pytest.mark.parametrize("apart", [0.02, 0.2, 30.0], ids=["one window", "a wider window", "gathered"])
@pytest.mark.parametrize("taps", [4, 8, 14])
def test_look_up_equals_its_twin_however_far_lanes_are_apart(double, monkeypatch, taps, apart):
    random = np.random.default_rng(taps)
    made = interpolation.deconvolved(taps, 2.0, 5, np.float64)
    row = random.standard_normal(400) + 1j * random.standard_normal(400)
    places = 200 + apart * random.uniform(-3, 3, 1001) + np.repeat(random.uniform(-90, 90, 126), 8)[:1001]
    table = np.concatenate([made.table.ravel(), row.view(np.float64)])
    body = (
        "dv w[TAPS], re, im; lv j; dv z = first_tap(LOAD(i, x), (dv)0, 400, 0, &j); tap_weights(z, table, w);"
        f"weighted_sum(table + {made.table.size}, j, w, &re, &im); STORE(re, i, out); STORE(im, i, out + n);"
    )
    macros = {"TAPS": taps, "TERMS": 5, "WRAP": 0, "table": table}
    re, im = probe(double, monkeypatch, body, places[None], 2, "interp_float64.clh", **macros)
    assert np.abs(re + 1j * im - interpolate(row, places, made)).max() < 2e-14 * np.abs(row).max()


def test_taps_never_leave_their_row(double, monkeypatch):
    body = (
        "lv j; first_tap(LOAD(i, x), LOAD(i, x + n), 100, 40, &j);"
        "dv k = 0; long lane[VW]; STORE(j, 0, lane); for (int l = 0; l < VW; l++) ((double *)&k)[l] = lane[l];"
        "STORE(k, i, out);"
    )
    table = interpolation.deconvolved(8, 2.0, 5, np.float64).table
    places = np.array([[0, -1e9, 1e9, 5e14, -5e14, 30, -30, 0], [0, 0, 0, 0, 0, 0, 0, 1e12]])
    macros = {"TAPS": 8, "TERMS": 5, "WRAP": 0, "table": table}
    first = probe(double, monkeypatch, body, places, 1, "interp_float64.clh", **macros)[0]
    assert first.min() >= -40 and first.max() + 8 + 3 <= 60


@pytest.mark.parametrize("taps", interpolator_choice.FLOAT64_TAPS)
def test_errors_of_kernels_are_within_their_prediction(taps):
    random = np.random.default_rng(taps)
    for oversample in interpolator_choice.FLOAT64_OVERSAMPLE:
        made = interpolation.interpolator_float64(taps, float(oversample))
        z = random.uniform(-0.5, 0.5, 300)
        place = np.arange(taps) - (taps - 1) / 2
        for nu in (0.5 / oversample, *random.uniform(0, 0.5 / oversample, 4)):
            got = (np.exp(2j * np.pi * nu * (place - z[:, None])) * made.weights(z)).sum(axis=-1) / made.transform(nu)
            assert abs(got - 1).max() <= 1.01 * made.error + 5e-15


def test_dark_places_are_as_rare_as_said():
    random = np.random.default_rng(5)
    energy = (random.standard_normal((200_000, 6, 2)) ** 2).sum(axis=-1) / 2
    for cells in (1, 2, 6):
        mean = energy[:, :cells].mean(axis=1)
        bound = error_bounds.darkness(cells, 1e-3)
        assert (mean < bound**-2).mean() == pytest.approx(1e-3, rel=0.3)
    assert error_bounds.darkness(1) == pytest.approx(1000, rel=1e-3) and error_bounds.darkness(1e4) < 1.05


def test_pulses_are_packed_in_pairs_that_are_exact_to_100_bits():
    random = np.random.default_rng(3)
    raw = noise_history(n_rows=5, n_samples=33)
    raw = replace(raw, frequency=random.uniform(1e9, 1e11, 5), frequency_step=random.uniform(1e5, 1e7, 5))
    made = packed(raw, geometry_of(raw, False), 66, 0, 5, 8)
    assert made.shape == (10, 8) and np.array_equal(made[:3, :5], raw.tx.T)
    getcontext().prec = 50
    c = Decimal(SPEED_OF_LIGHT)
    for p in range(5):
        f, df = Decimal(float(raw.frequency[p])), Decimal(float(raw.frequency_step[p]))
        wanted = 2 * (f + 16 * df) / c, 2 * df * 66 / c, c / (4 * df)
        for i, value in zip((4, 6, 8), wanted, strict=True):
            got = Decimal(float(made[i, p])) + Decimal(float(made[i + 1, p]))
            assert abs(got - value) <= abs(value) * Decimal(2) ** -100


@pytest.mark.parametrize("length", [1, 17, 64, 1000])
@pytest.mark.parametrize("inverse", [False, True])
def test_double_ffts_are_exact_to_double(device, length, inverse):
    random = np.random.default_rng(0)
    data = random.standard_normal((3, length)) + 1j * random.standard_normal((3, length))
    wanted = np.fft.ifft(data) * length if inverse else np.fft.fft(data)
    made = [fft.rows(on, data, inverse=inverse) for on in (device, None)]
    made += [fft.reikna_rows(device, data, inverse)] if device.info.fp64 and length == 64 else []
    for got in made:
        assert got.dtype == np.complex128
        assert np.linalg.norm(got - wanted) <= 2e-15 * np.linalg.norm(wanted)
