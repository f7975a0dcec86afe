"""Windows: widths and side lobes of their continuous forms, at any number of cells."""

import numpy as np
import pytest

from sarcl.numerics.windows import TABLE, both, check, in_words, parse, table, weights

TAYLOR = ("taylor", 35, 5)
# window, width at half power in cells of 1/B, highest side lobe in dB, of the continuous windows' transforms
FIGURES = [(None, 0.886, -13.26), ("hamming", 1.303, -42.67), (TAYLOR, 1.188, -35.22)]


def response(window, n, u):
    """|sum_i w_i exp(j 2 pi u x_i)|^2 over its peak, cells' middles x_i in [-1/2, 1/2]."""
    w = weights(window, n)
    x = (np.arange(n) + 0.5) / n - 0.5
    return np.abs(np.exp(2j * np.pi * u[:, None] * x) @ w) ** 2 / w.sum() ** 2


@pytest.mark.parametrize("n", [127, 256, 301])
@pytest.mark.parametrize(("window", "width", "lobe"), FIGURES)
def test_width_and_side_lobe_are_those_of_the_continuous_window(window, width, lobe, n):
    u = np.linspace(0, 12, 12001)
    p = response(window, n, u)
    null = int((np.diff(p) > 0).argmax())
    assert 2 * np.interp(-0.5, -p[:null], u[:null]) == pytest.approx(width, abs=1e-3)
    # 127 cells: the lobes of a sum of n terms stand 1/(1 - (pi u/n)^2/6) above an integral's
    assert 10 * np.log10(p[null:].max()) == pytest.approx(lobe, abs=0.03)


@pytest.mark.parametrize("window", [None, "hamming", ("hamming",), TAYLOR, ["taylor", 20.0, 1]])
def test_weights_are_symmetric_positive_and_at_most_one(window):
    for n in (1, 2, 7, 64):
        w = weights(window, n)
        assert w.shape == (n,) and w.dtype == np.float64
        np.testing.assert_allclose(w, w[::-1], rtol=1e-12)
        assert (w > 0).all() and w.max() <= 1 + 1e-12
    assert weights(window, 1)[0] == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize(("level", "nbar"), [(35, 5), (30, 4), (50, 9), (35, 2), (20, 1)])
def test_taylor_is_scipys(level, nbar):
    taylor = pytest.importorskip("scipy.signal.windows").taylor
    for n in (2, 33, 128):
        np.testing.assert_allclose(weights(("taylor", level, nbar), n), taylor(n, nbar, level), rtol=1e-12)


def test_hamming_at_its_middle_and_quarters():
    np.testing.assert_allclose(weights("hamming", 2), 0.54)  # u = +-1/4
    np.testing.assert_allclose(weights("hamming", 3), [0.31, 1, 0.31])  # u = +-1/3, 0


@pytest.mark.parametrize(
    ("text", "window"),
    [
        ("none", None),
        ("hamming", "hamming"),
        (" Taylor:35:5", ("taylor", 35.0, 5.0)),
        ("taylor:27.5:4", ("taylor", 27.5, 4.0)),
        ("hann", "hann"),
        ("kaiser:8.6", ("kaiser", 8.6)),
    ],
)
def test_the_command_lines_form_is_read(text, window):
    assert parse(text) == window
    assert weights(parse(text), 5).shape == (5,)


@pytest.mark.parametrize(
    "window",
    ["han", 3, (), ("taylor", 35), ("hamming", 2), "get_window", ("taylor", 35, 5, 1)],
)
def test_an_unknown_window_is_refused_with_those_there_are(window):
    with pytest.raises(ValueError, match=r"known are None, 'hamming', \('taylor', sidelobe_db, nbar\)"):
        weights(window, 8)


@pytest.mark.parametrize(
    ("window", "message"),
    [
        (("taylor", -35, 5), "sidelobe_db is -35; it must be greater than 0"),
        (("taylor", 35, 0), "nbar is 0; it must be at least 1"),
        (("taylor", 35, 4.5), "nbar must be a whole number"),
        (("taylor", np.nan, 5), "sidelobe_db is nan"),
        (("taylor", 3, 20), "weights below zero; lower nbar or raise sidelobe_db"),
    ],
)
def test_a_taylor_window_that_cannot_be_is_refused(window, message):
    with pytest.raises(ValueError, match=message):
        weights(window, 64)


@pytest.mark.parametrize(
    "text", ["", "han", "taylor:35", "taylor:a:5", "none:1", "hamming:1", "hann,none,hann", "hann,"]
)
def test_a_text_that_names_no_window_is_refused_with_an_example(text):
    with pytest.raises(ValueError, match=r"wanted none, hamming or taylor:35:5"):
        parse(text)


@pytest.mark.parametrize("n", [0, -1, 2.5])
def test_an_invalid_number_of_cells_is_refused(n):
    with pytest.raises(ValueError, match="n "):
        weights(None, n)


def test_a_pair_in_the_command_lines_form():
    assert parse("taylor:35:5, none") == (("taylor", 35.0, 5.0), None)


@pytest.mark.parametrize(
    ("window", "form"),
    [
        ("hann", lambda u: np.cos(np.pi * u) ** 2),
        ("cosine", lambda u: np.cos(np.pi * u)),
        ("bartlett", lambda u: 1 - 2 * np.abs(u)),
        (("kaiser", 6.0), lambda u: np.i0(6 * np.sqrt(1 - 4 * u**2)) / np.i0(6)),
        ("blackman", lambda u: 0.42 + 0.5 * np.cos(2 * np.pi * u) + 0.08 * np.cos(4 * np.pi * u)),
        (("general_cosine", [0.5, 0.5]), lambda u: np.cos(np.pi * u) ** 2),
        ("boxcar", np.ones_like),
        ("taylor", lambda u: weights(("taylor", 30, 4), len(u))),
    ],
)
def test_windows_of_scipy_are_their_continuous_forms_at_the_middles_of_cells(window, form):
    for n in (1, 6, 33):
        u = (np.arange(n) + 0.5) / n - 0.5
        np.testing.assert_allclose(weights(window, n), form(u), atol=1e-12)


def test_windows_that_count_cells_are_scipys():
    scipy = pytest.importorskip("scipy.signal.windows")
    np.testing.assert_allclose(weights(("gaussian", 4.0), 24), scipy.gaussian(24, 4.0))
    np.testing.assert_allclose(weights(("chebwin", 60), 24), scipy.chebwin(24, 60))
    np.testing.assert_allclose(weights(("dpss", 2.5), 24), scipy.dpss(24, 2.5))


def test_a_pair_is_for_range_and_cross_range():
    taper = np.linspace(1, 2, 5)
    for window, wanted in (
        (None, (None, None)),
        ("hann", ("hann", "hann")),
        (TAYLOR, (TAYLOR, TAYLOR)),
        (("kaiser", 8.6), (("kaiser", 8.6),) * 2),
        (("hann", None), ("hann", None)),
        (["hamming", ["taylor", 35, 5]], ("hamming", ["taylor", 35, 5])),
        ((("kaiser", 3.0), "hann"), (("kaiser", 3.0), "hann")),
        (("general_cosine", [1.0, 0.5]), (("general_cosine", [1.0, 0.5]),) * 2),
    ):
        assert both(window) == wanted
    across, along = both((taper, "hann"))
    assert across is taper and along == "hann"
    check((taper, "hann"))
    assert in_words((taper, TAYLOR)) == "array x taylor 35 5" and in_words(TAYLOR) == "taylor 35 5"
    assert in_words(("hamming", None)) == "hamming x none" and in_words(None) is None
    np.testing.assert_array_equal(weights(taper, 5), taper)


def test_a_table_is_the_window_over_an_aperture_of_any_length():
    u = (np.arange(TABLE) + 0.5) / TABLE - 0.5
    np.testing.assert_allclose(table("hann"), np.cos(np.pi * u) ** 2, atol=1e-12)
    assert table(np.array([1.0, 3.0])) == pytest.approx(np.clip(2 + 4 * u, 1, 3))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: weights("flattop", 64), "'flattop' has weights of -0.0"),
        (lambda: weights("kaiser", 8), "'kaiser' takes beta"),
        (lambda: weights(("hann", 3), 8), "'hann' takes no parameters"),
        (lambda: weights(("kaiser", np.nan), 8), "kaiser beta is nan"),
        (lambda: weights(np.ones(4), 8), r"window has shape \(4,\), wanted \(8,\)"),
        (lambda: weights([0.0, 0.0], 2), "not all are zero"),
        (lambda: weights(("kaiser_bessel_derived", 4), 7), "even numbers of cells, not 7"),
        (lambda: both(np.ones(4)), r"window is an array; give \(range, cross-range\)"),
        (lambda: table(("gaussian", 4.0)), "depends on the number of rows"),
    ],
)
def test_other_windows_that_cannot_be_say_why(call, message):
    with pytest.raises(ValueError, match=message):
        call()
