"""Windows over frequency and over the aperture: they trade resolution for lower side lobes."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from ..base import validation

Window = Literal["hamming"] | tuple[Literal["taylor"], float, float]  # sidelobe_db, nbar
KNOWN = "None, 'hamming', ('taylor', sidelobe_db, nbar) such as ('taylor', 35, 5)"


def weights(window: Window | None, n: int) -> np.ndarray:
    """Weights of n equal cells of an aperture or a band, float64 (n,).

    window  None (all ones), "hamming" or ("taylor", sidelobe_db, nbar), sidelobe_db > 0 below the main lobe
    n       number of cells

    The continuous window w(u), |u| <= 1/2, is taken at the cells' middles u = (i + 1/2)/n - 1/2, so that it
    spans the band of n cells whatever n is (sampled from edge to edge it would span n - 1). w(0) = 1; the
    samples are not scaled further: `Image.gain` counts their sum.
    ValueError names the window it was given and lists those there are.
    Source: Carrara, Goodman and Majewski, "Spotlight Synthetic Aperture Radar", 1995, appendix D.
    """
    n = validation.count("n", n)
    name, parameters = _name(window)
    u = (np.arange(n) + 0.5) / n - 0.5
    if name == "hamming":
        return 0.54 + 0.46 * np.cos(2 * np.pi * u)
    if name == "taylor":
        return _taylor(u, *parameters)
    return np.ones(n)


def parse(text: str) -> Window | None:
    """The window a command line names: "none", "hamming" or "taylor:35:5" (side lobes in dB, nbar)."""
    name, *rest = text.strip().lower().split(":")
    if name == "none" and not rest:
        return None
    try:
        window: Any = (name, *(float(x) for x in rest)) if rest else name
        _name(window)
    except ValueError as exc:
        raise ValueError(f"window {text!r}: wanted none, hamming or taylor:35:5 (dB, nbar); {exc}") from None
    return window


def _name(window: Any) -> tuple[str, tuple[float, ...]]:
    """Checked (name, parameters) of any window."""
    if window is None:
        return "none", ()
    name, *rest = tuple(window) if isinstance(window, (list, tuple)) and window else (window,)
    if not isinstance(name, str) or (name, len(rest)) not in (("hamming", 0), ("taylor", 2)):
        raise ValueError(f"window is {' '.join(repr(window).split()):.60}; known are {KNOWN}")
    if name == "hamming":
        return "hamming", ()
    level = validation.number("taylor sidelobe_db", rest[0], above=0)
    return "taylor", (level, validation.count("taylor nbar", rest[1]))


def _taylor(u: np.ndarray, sidelobe_db: float, nbar: float) -> np.ndarray:
    """w(u) = 1 + 2 sum_m F_m cos(2 pi m u), over w(0); nbar - 1 lobes on each side near -sidelobe_db."""
    a2 = (np.arccosh(10 ** (sidelobe_db / 20)) / np.pi) ** 2
    m = np.arange(1, int(nbar))
    stretch = nbar**2 / (a2 + (nbar - 0.5) ** 2)
    above = np.prod(1 - m[:, None] ** 2 / stretch / (a2 + (m - 0.5) ** 2), axis=1)
    below = np.prod(1 - m[:, None] ** 2 / m**2 + np.eye(len(m)), axis=1)  # the factor of m itself is left out
    f = -((-1.0) ** m) * above / below / 2
    made = (1 + 2 * np.cos(2 * np.pi * u[:, None] * m) @ f) / (1 + 2 * f.sum())
    if (made <= 0).any():
        raise ValueError(
            f"taylor window of {sidelobe_db:g} dB with nbar {nbar:g} has weights below zero; "
            "lower nbar or raise sidelobe_db"
        )
    return made
