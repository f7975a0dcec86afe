"""The helpers of kernels/*.clh, one by one, against float64."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.kernel_probe import probe

from sarcl.base import float_pairs
from sarcl.numerics import interpolation
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.reference.geometry import half_path
from sarcl.reference.interp import interpolate

# name -> (expression in w_ functions, numpy twin, error bound relative to the result without float64)
WIDE = {
    "add": ("w_add(a, b)", lambda a, b: a + b, 3 * 2.0**-48),
    "sub": ("w_sub(a, b)", lambda a, b: a - b, 3 * 2.0**-48),
    "mul": ("w_mul(a, b)", lambda a, b: a * b, 5 * 2.0**-48),
    "div": ("w_div(a, b)", lambda a, b: a / b, 12 * 2.0**-48),
    "sqrt": ("w_sqrt(a)", lambda a, b: np.sqrt(a), 5 * 2.0**-48),
}


@pytest.fixture
def device(every_device):
    """All twins: lanes and number types in every combination, which costs little here."""
    return every_device


def pairs(random, n):
    """Numbers over many magnitudes as hi and lo float32 parts, and their exact sum."""
    wide = float_pairs.wide(random.uniform(1, 2, n) * 10.0 ** random.integers(-3, 8, n))
    return wide, wide[0].astype(np.float64) + wide[1]


@pytest.mark.parametrize("name", WIDE)
def test_wide_numbers_keep_their_error_bound(device, monkeypatch, name):
    expression, twin, bound = WIDE[name]
    random = np.random.default_rng(1)
    (a, exact_a), (b, exact_b) = pairs(random, 4001), pairs(random, 4001)
    body = (
        "wv a = w_make(LOAD(i, x), LOAD(i, x + n)), b = w_make(LOAD(i, x + 2 * n), LOAD(i, x + 3 * n));"
        f"wv r = {expression}; STORE(w_float(r), i, out); STORE(w_low(r), i, out + n);"
    )
    hi, lo = probe(device, monkeypatch, body, np.concatenate([a, b]), 2)
    wanted = twin(exact_a, exact_b)
    # a difference may cancel: its error is relative to the terms
    scale = np.abs(exact_a) + np.abs(exact_b) if name in ("add", "sub") else np.abs(wanted)
    assert (np.abs(hi.astype(np.float64) + lo - wanted) <= bound * scale).all()


def test_wide_split_gives_the_nearest_integer_and_the_rest(device, monkeypatch):
    random = np.random.default_rng(2)
    values = random.uniform(-1, 1, 4001) * 10.0 ** random.uniform(-2, 9, 4001)
    wide = float_pairs.wide(values)
    exact = wide[0].astype(np.float64) + wide[1]
    body = (
        "iv k; fv rest = w_split(w_make(LOAD(i, x), LOAD(i, x + n)), &k);"
        "STORE(AS_FLOAT(k), i, out); STORE(rest, i, out + n);"
    )
    whole, rest = probe(device, monkeypatch, body, wide, 2)
    whole = whole.view(np.int32)
    assert (np.abs(rest) <= 0.5 + 1e-6).all()
    # 48 bits of a number up to 1e9 leave 4e-6 of a turn
    assert (np.abs(whole + rest.astype(np.float64) - exact) <= 1e-7 + np.abs(exact) * 2.0**-47).all()


def test_wide_square_root_of_zero_is_zero(device, monkeypatch):
    body = "wv r = w_sqrt(w_make(LOAD(i, x), (fv)0)); STORE(w_float(r), i, out); STORE(w_low(r), i, out + n);"
    hi, lo = probe(device, monkeypatch, body, np.zeros((1, 8), np.float32), 2)
    assert (hi == 0).all() and (lo == 0).all()


def test_sine_and_cosine_of_turns_err_less_than_4e_7(device, monkeypatch):
    turns = np.linspace(-0.5, 0.5, 20001, dtype=np.float32)[None]
    body = "fv s, c; sincos_cycles(LOAD(i, x), &s, &c); STORE(s, i, out); STORE(c, i, out + n);"
    sine, cosine = probe(device, monkeypatch, body, turns, 2)
    angle = 2 * np.pi * turns[0].astype(np.float64)
    assert np.abs(sine - np.sin(angle)).max() < 4e-7
    assert np.abs(cosine - np.cos(angle)).max() < 4e-7


@pytest.mark.parametrize("distance", [0.0, 3.0, 1e4, 8e5, 3.6e7])
def test_half_path_keeps_a_tenth_of_a_nanometre_at_any_distance(device, monkeypatch, distance):
    random = np.random.default_rng(3)
    points = random.uniform(-500, 500, (801, 3))
    tx = np.array([0.6, -0.3, 0.74]) * distance
    rx = tx + np.array([20.0, 5.0, 1.0])
    one = np.ones(1)
    reference = one * (np.linalg.norm(tx) + np.linalg.norm(rx)) / 2
    antennas = PulseGeometry(tx[None], rx[None], reference, one * 9.6e9, one, -one, one)
    packed = antennas.packed(np.zeros(3), 64, 0, 1, 1)
    body = (
        "point p; p.x = w_make(LOAD(i, x), LOAD(i, x + 3 * n)); p.y = w_make(LOAD(i, x + n), LOAD(i, x + 4 * n));"
        "p.z = w_make(LOAD(i, x + 2 * n), LOAD(i, x + 5 * n)); wv d = half_path(table, 0, 1, p);"
        "STORE(w_float(d), i, out); STORE(w_low(d), i, out + n);"
    )
    macros = {"BISTATIC": 1, "WRAP": 0, "RANGE": 2, "table": packed}
    headers = ("common.clh", "doubleword.clh", "geometry.clh")
    hi, lo = probe(device, monkeypatch, body, float_pairs.wide(points.T).reshape(6, -1), 2, headers, **macros)
    wanted = half_path(tx, rx, points, 0) - half_path(tx, rx, np.zeros((1, 3)), 0)
    # 48 bits of points up to 870 m from the centre, five operations
    assert float(np.abs(hi.astype(np.longdouble) + lo - wanted).max()) < 1e-10


@pytest.mark.parametrize("taps", interpolation.TERMS)
def test_look_up_equals_its_twin(device, monkeypatch, taps):
    random = np.random.default_rng(taps)
    made = interpolation.interpolator(taps, 2.0)
    row = (random.standard_normal(200) + 1j * random.standard_normal(200)).astype(np.complex64)
    places = random.uniform(10, 180, 1001).astype(np.float32)
    table = np.concatenate([made.table.ravel(), row.view(np.float32)])
    body = (
        f"fv re, im; look_up(table + {made.table.size}, 200, 0, (iv)0, LOAD(i, x), table, &re, &im);"
        "STORE(re, i, out); STORE(im, i, out + n);"
    )
    macros = {"TAPS": taps, "TERMS": interpolation.TERMS[taps], "WRAP": 0, "table": table}
    re, im = probe(device, monkeypatch, body, places[None], 2, ("common.clh", "interp.clh"), **macros)
    wanted = interpolate(row, places, made)
    # places near sample 200 are rounded to 2^-17 before this code sees them; the twin sees the same
    assert np.abs(re + 1j * im - wanted).max() < 3e-6 * np.abs(row).max()


@pytest.mark.parametrize("taps", [2, 4, 6, 8])
def test_scatterers_that_meet_in_a_row_of_any_length_add_up_with_the_error_of_each_addition(device, monkeypatch, taps):
    lanes, times = device.info.vector_width, 4000
    stride = 2 * lanes + 9  # the last numbers of a row fill no vector
    random = np.random.default_rng(5)
    first = random.integers(0, stride - taps + 1, lanes).astype(np.float32)
    first[0], first[-1] = 0, stride - taps  # the ends of a row
    echo, weights = random.uniform(0.5, 1, (2, lanes)), random.uniform(0.5, 1, (taps, lanes))
    given = np.concatenate([first[None], echo, weights]).astype(np.float32)
    sums = -(-4 * stride // 16) * 16  # where they begin: at a multiple of 32 bytes
    body = (
        "row_window window;"
        f"spread_rows rows = begin_rows(&window, out + {sums}, out, 0, 1, {stride}, 0);"
        f"for (int m = 0; m < {times}; m++) {{"
        "fv w[TAPS]; for (int k = 0; k < TAPS; k++) w[k] = LOAD(0, x + (3 + k) * n);"
        "add_scatterers(&rows, 0, (iv)1, nearest_int(LOAD(0, x)), w, LOAD(0, x + n), LOAD(0, x + 2 * n));"
        "empty_rows(&rows); }"
    )
    macros = {"TAPS": taps, "GROUPED": 0, "SUMS": 4 if lanes > 1 else 1}
    planes = -(-(sums + 8 * (stride + 16)) // lanes)
    out = probe(device, monkeypatch, body, given, planes, ("common.clh", "spread_rows.clh"), **macros).ravel()
    exact = np.zeros((stride, 2))
    for lane, at in enumerate(first.astype(int)):
        exact[at : at + taps] += given[3:, lane, None].astype(np.float64) * given[1:3, lane].astype(np.float64)
    exact = times * exact.ravel()
    total, error = out[: 4 * stride].reshape(2, -1).astype(np.float64)
    assert (out[sums : sums + 8 * stride] == 0).all()
    # one float32 sum is some roundings wrong, always the same; the error of adding it to the total is added back
    allowed = 4 * lanes * 2.0**-24
    assert (np.abs(total + error - exact) <= allowed * exact).all()
    assert np.abs(error).max() > 10 * 2.0**-24 * exact.max()  # without it 1e-5 would be lost
