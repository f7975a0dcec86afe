"""Windows: widths and side lobes of their continuous forms, at any number of cells."""

import numpy as np
import pytest

from sarcl.numerics.windows import parse, weights

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
    ],
)
def test_the_command_lines_form_is_read(text, window):
    assert parse(text) == window
    assert weights(parse(text), 5).shape == (5,)


@pytest.mark.parametrize(
    "window",
    ["hann", 3, (), ("taylor",), ("taylor", 35), ("hamming", 2), np.ones(4), ("taylor", 35, 5, 1)],
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


@pytest.mark.parametrize("text", ["", "hann", "taylor", "taylor:35", "taylor:a:5", "none:1", "hamming:1"])
def test_a_text_that_names_no_window_is_refused_with_an_example(text):
    with pytest.raises(ValueError, match=r"wanted none, hamming or taylor:35:5"):
        parse(text)


@pytest.mark.parametrize("n", [0, -1, 2.5])
def test_an_invalid_number_of_cells_is_refused(n):
    with pytest.raises(ValueError, match="n "):
        weights(None, n)
