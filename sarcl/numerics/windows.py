"""Windows over frequency and over the aperture: they trade resolution for lower side lobes."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..base import validation
from ..base.text import shown

# of one direction: a name, (name, parameters) or an array; or a pair of these, or None, for range and cross-range
WindowName = Literal[
    "none", "taylor", "hamming", "barthann", "bartlett", "blackman", "blackmanharris", "bohman", "boxcar", "chebwin",
    "cosine", "dpss", "exponential", "flattop", "gaussian", "general_cosine", "general_gaussian", "general_hamming",
    "hann", "kaiser", "kaiser_bessel_derived", "lanczos", "nuttall", "parzen", "triang", "tukey",
]  # fmt: skip
OneWindow = WindowName | Sequence[WindowName | float | Sequence[float]] | NDArray[Any]
Window = OneWindow | Sequence[OneWindow | None]
KNOWN = (
    "None, 'hamming', ('taylor', sidelobe_db, nbar) such as ('taylor', 35, 5), the names in scipy.signal.windows such "
    "as 'hann' or ('kaiser', 8.6), an array of weights, and a pair (range, cross-range) of these"
)
# windows that SciPy samples from edge to edge
EDGE_TO_EDGE = (
    "bartlett", "barthann", "blackman", "blackmanharris", "bohman", "flattop", "general_cosine", "general_hamming",
    "hann", "kaiser", "lanczos", "nuttall", "tukey",
)  # fmt: skip
# windows that have no continuous form: their parameters count cells, or their shape hinges on the number of cells
OF_CELLS = ("chebwin", "exponential", "gaussian", "general_gaussian", "kaiser_bessel_derived")
TABLE = 2**18  # cells of `table`: linear interpolation between them has an error of 4e-11 of a Hamming window


def weights(window: Window | None, n: int) -> np.ndarray:
    """Weights of n equal cells of an aperture or a band, float64 (n,).

    window  None (all ones), "hamming", ("taylor", sidelobe_db, nbar), sidelobe_db > 0 below the main lobe, a name of
            scipy.signal.windows, (name, parameters...) with the parameters in SciPy's order, or an array (n,)
    n       number of cells

    The continuous window w(u), |u| <= 1/2, is taken at the cells' middles u = (i + 1/2)/n - 1/2, so that it
    spans the band of n cells whatever n is (sampled from edge to edge it would span n - 1). Windows whose parameters
    count cells, such as a Gaussian's, are SciPy's of n samples. The samples are not scaled: `Image.gain` counts their
    sum. ValueError names the window it was given and lists those there are, or names weights below zero.
    Source: Carrara, Goodman and Majewski, "Spotlight Synthetic Aperture Radar", 1995, appendix D.
    """
    n = validation.count("n", n)
    if is_array(window):
        w = validation.array("window", window, np.float64, (n,))
    else:
        w = _named(*_name(window), n)
    if not np.isfinite(w).all():
        raise ValueError(
            f"window {shown(window)} of {n} cells has weights that are not finite; its parameters are too large or 0"
        )
    if (w < 0).any() or not w.any():
        raise ValueError(
            f"window {shown(window)} has weights of {w.min():g} to {w.max():g}; a weight is not "
            "below zero, and not all are zero"
        )
    return w


def table(window: Window | None) -> np.ndarray:
    """w(u) at the middles of TABLE equal cells of |u| <= 1/2, for apertures of any number of rows, float64.

    An array of weights is interpolated between its own cells. ValueError for a window without a continuous form.
    """
    if is_array(window):
        w = weights(window, len(np.asarray(window)))
        n = len(w)
        return np.interp((np.arange(TABLE) + 0.5) / TABLE, (np.arange(n) + 0.5) / n, w)
    name, _ = _name(window)
    if name in OF_CELLS:
        raise ValueError(
            f"window {shown(window)} depends on the number of rows, and with a beam each pixel is seen by another "
            "number of them; give an array of weights, which is stretched over the aperture of each pixel"
        )
    return weights(window, TABLE)


def both(window: Window | None) -> tuple[Any, Any]:
    """The windows in range and in cross-range: of a pair its parts, of any other window itself twice."""
    if isinstance(window, (tuple, list)) and len(window) == 2:
        first, second = window
        parameters = first == "general_cosine" if isinstance(first, str) else False
        if not isinstance(second, (int, float, np.number)) and not parameters:
            return first, second
    if is_array(window):
        raise ValueError(
            "window is an array; give (range, cross-range): weights of the samples, and of the rows of an aperture"
        )
    return window, window


def is_array(window: Any) -> bool:
    """Whether a window is given as its weights."""
    listed = isinstance(window, (tuple, list)) and len(window) > 0 and not isinstance(window[0], str)
    return listed or (not isinstance(window, (str, tuple, list)) and np.ndim(window) > 0)


def check(window: Window | None) -> None:
    """ValueError for a window that cannot be, whatever the number of cells."""
    for one in both(window):
        weights(one, len(one) if is_array(one) else 8)


def in_words(window: Window | None) -> str | None:
    """A window as text: "hamming", "taylor 35 5", "hann x none"; None for None."""
    if window is None:
        return None
    across, along = both(window)
    return _words(across) if across is along else f"{_words(across)} x {_words(along)}"


def parse(text: str) -> Window | None:
    """The window a command line names: "none", "hamming", "taylor:35:5" (side lobes in dB, nbar), "kaiser:8.6", or
    two of these for range and cross-range, "hann,none"."""
    parts = [part.strip() for part in text.split(",")]
    try:
        if len(parts) > 2:
            raise ValueError("more than two windows")
        made = [_parsed(part) for part in parts]
    except ValueError as exc:
        raise ValueError(
            f"window {text!r}: wanted none, hamming or taylor:35:5 (dB, nbar), another name of scipy.signal.windows "
            f"such as hann or kaiser:8.6, or two of these, range,cross-range; {exc}"
        ) from None
    return made[0] if len(made) == 1 else (made[0], made[1])


def _parsed(text: str) -> Any:
    name, *rest = text.lower().split(":")
    if name == "none" and not rest:
        return None
    window: Any = (name, *(float(x) for x in rest)) if rest else name
    _name(window)
    return window


def _words(window: object) -> str:
    if window is None:
        return "none"
    if is_array(window):
        return "array"
    name, parameters = _name(window)
    return " ".join([name, *(f"{p:g}" if np.ndim(p) == 0 else "array" for p in parameters)])


def _name(window: object) -> tuple[str, tuple[Any, ...]]:
    """Checked (name, parameters) of a window that is no array."""
    if window is None:
        return "none", ()
    name, *rest = tuple(window) if isinstance(window, (list, tuple)) and window else (window,)
    if not isinstance(name, str):
        raise ValueError(f"window is {shown(window)}; known are {KNOWN}")
    if name == "taylor" and len(rest) in (0, 2):
        level, nbar = rest or (30.0, 4)
        level = _bounded("taylor sidelobe_db", validation.number("taylor sidelobe_db", level, above=0))
        return name, (level, int(_bounded("taylor nbar", validation.count("taylor nbar", nbar))))
    if name == "hamming" and not rest:
        return name, ()
    from scipy.signal import windows

    if name in ("taylor", "hamming") or name not in windows.__all__ or name == "get_window":
        raise ValueError(f"window is {shown(window)}; known are {KNOWN}")
    parameters = [p for p in inspect.signature(getattr(windows, name)).parameters.values() if p.name in PARAMETERS]
    least = sum(p.default is inspect.Parameter.empty for p in parameters)
    if not least <= len(rest) <= len(parameters):
        names = ", ".join(p.name for p in parameters) or "no parameters"
        raise ValueError(f"window is {shown(window)}; {name!r} takes {names}")
    for p, value in zip(parameters, rest, strict=False):
        if p.name == "a":
            validation.array("general_cosine a", value, np.float64, ("n",))
        elif value is not None:
            number = validation.number(f"{name} {p.name}", value)
            if p.name in LARGEST:
                _bounded(f"{name} {p.name}", number)
    return name, tuple(rest)


def _bounded(name: str, value: float) -> float:
    """`value`; ValueError where it is so large that the formulas of the window overflow, or take all memory."""
    most = LARGEST[name.split()[-1]]
    if abs(value) > most:
        raise ValueError(f"{name} is {value:g}; windows take at most {most:g}")
    return value


# largest moduli of parameters: dB below 1e-15, terms of a series, and an argument whose Bessel function is finite
LARGEST = {"sidelobe_db": 300.0, "nbar": 200, "at": 300.0, "beta": 700.0}
# parameters of SciPy's windows; others of its arguments say how they are sampled and on what device
PARAMETERS = ("beta", "std", "p", "sig", "a", "alpha", "at", "center", "tau", "NW")


def _named(name: str, parameters: tuple[Any, ...], n: int) -> np.ndarray:
    u = (np.arange(n) + 0.5) / n - 0.5
    if name == "none":
        return np.ones(n)
    if name == "hamming":
        return np.asarray(0.54 + 0.46 * np.cos(2 * np.pi * u))
    if name == "taylor":
        return _taylor(u, *parameters)
    from scipy.signal import windows

    if name == "dpss" and not 0 < parameters[0] < n / 2:
        raise ValueError(f"dpss NW is {parameters[0]:g}; it lies above 0 and below half the number of cells, {n}")
    function = getattr(windows, name)
    with np.errstate(all="ignore"):  # weights that are not finite are refused by the name of the window
        return _of_scipy(function, name, parameters, n)


def _of_scipy(function: Callable[..., np.ndarray], name: str, parameters: tuple[Any, ...], n: int) -> np.ndarray:
    if name in EDGE_TO_EDGE:  # every other of 2 n + 1 samples from edge to edge is the middle of a cell
        return np.asarray(function(2 * n + 1, *parameters, sym=True)[1::2], np.float64)
    if name == "kaiser_bessel_derived" and n % 2:
        raise ValueError(f"window 'kaiser_bessel_derived' is for even numbers of cells, not {n}; take 'kaiser'")
    return np.asarray(function(n, *parameters, sym=True), np.float64)


def _taylor(u: np.ndarray, sidelobe_db: float, nbar: float) -> np.ndarray:
    """w(u) = 1 + 2 sum_m F_m cos(2 pi m u), over w(0); nbar - 1 lobes on each side near -sidelobe_db."""
    a2 = (np.arccosh(10 ** (sidelobe_db / 20)) / np.pi) ** 2
    m = np.arange(1, int(nbar))
    stretch = nbar**2 / (a2 + (nbar - 0.5) ** 2)
    numerator = np.prod(1 - m[:, None] ** 2 / stretch / (a2 + (m - 0.5) ** 2), axis=1)
    denominator = np.prod(1 - m[:, None] ** 2 / m**2 + np.eye(len(m)), axis=1)  # the factor of m itself is left out
    f = -((-1.0) ** m) * numerator / denominator / 2
    w = (1 + 2 * np.cos(2 * np.pi * u[:, None] * m) @ f) / (1 + 2 * f.sum())
    if (w <= 0).any():
        raise ValueError(
            f"taylor window of {sidelobe_db:g} dB with nbar {nbar:g} has weights below zero; "
            "lower nbar or raise sidelobe_db"
        )
    return w
