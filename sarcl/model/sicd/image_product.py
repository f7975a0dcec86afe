"""An image on a plane as what a SICD file says of it: Earth-fixed, with its collection; what is missing is refused.

Equations: docs/theory/sicd.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Literal, TypedDict

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike

from ...base import validation, wgs84
from ...base.constants import SPEED_OF_LIGHT
from ...base.rows import spread_over
from ...io.cphd.names import names_of
from ...io.sarkit_library import library as sarkit_module
from ...io.sicd.writing import Direction, Order, Product, Tracks
from ..cphd.words import LATER, POLARIZATIONS, Words, frame, per_row
from . import _polynomials
from ._spectrum import MOST_ROWS, Aperture, window_weights

if TYPE_CHECKING:
    from ..image import Image
    from ..phase_history import PhaseHistory

MODES = ("SPOTLIGHT", "STRIPMAP", "DYNAMIC STRIPMAP")
REQUIRED = ("CollectorName", "CoreName", "ModeType", "Classification")
OPTIONAL = ("ModeID", "CountryCode", "AzAutofocus", "RgAutofocus")
OTHERS = ("IlluminatorName", "CollectionStart", "TxPol", "RcvPol", "TxTime", "ImpRespWid")
SAME = 1.0  # m: farther from where the sender has moved on to, the receiver is on another platform
FARTHEST = 0.3  # m, by which a polynomial may miss a track
FIT = 1e-3, 0.02  # of a bandwidth or dwell: error at which a fit stops, and that is the most
UNKNOWN = 1.0  # gain of an image that was not made by sarcl
GAIN = 0.05  # of a gain with windows, by which sums of few weights differ from their integrals
LEAST_SHARE = 0.5  # of the largest bandwidth in an image, which the file gives for all of its pixels


class EarthOptions(TypedDict, total=False):
    """Arguments of `Image.save` for SICD files, as its docstring has them."""

    collection: PhaseHistory
    origin: ArrayLike | None
    axes: ArrayLike | None
    metadata: Mapping[str, ArrayLike | np.datetime64] | None
    version: Literal["1.3.0", "1.4.0"] | None


def product_of(
    image: Image,
    *,
    collection: PhaseHistory | None = None,
    origin: ArrayLike | None = None,
    axes: ArrayLike | None = None,
    metadata: Mapping[str, ArrayLike | np.datetime64] | None = None,
    version: Literal["1.3.0", "1.4.0"] | None = None,
) -> Product:
    """The arguments of `Image.save` for SICD, checked, and all that the file says."""
    from ..phase_history import PhaseHistory

    _check_image(image)
    if collection is None:
        raise ValueError(
            "SICD describes the collection of an image, which the image does not hold; give collection=, the phase "
            "history that it was made of"
        )
    validation.instance("collection", collection, PhaseHistory)
    raw = collection
    _check_collection(image, raw)
    words = words_of(raw, metadata)
    corner, local = frame(raw.tx[0], "SICD", origin, axes)
    time = per_row(raw, words, "time", "TxTime", ())
    shift = int(np.floor(time.min()))  # s: the clock of the file starts within a second before the first pulse
    tx, rx = (corner + positions @ local for positions in (raw.tx, raw.rx))
    scp = corner + image.grid.at(image.shape[0] // 2, image.shape[1] // 2) @ local
    clock, tracks = _tracks(raw, time - shift, tx, rx, scp)
    names = {key: words.text(key) for key in REQUIRED}
    names |= {key: words.text(key) for key in OPTIONAL if key in words.values}
    if not tracks.is_monostatic:
        names["IlluminatorName"] = words.text("IlluminatorName")
    versions = ("1.3.0", "1.4.0") if tracks.is_monostatic else ("1.4.0",)
    release = validation.choice("version", versions[0] if version is None else version, versions)
    order, directions = _order(image, local, scp, polynomial.polyval(float(np.median(clock)), tracks.arp))
    aperture = _aperture(image, raw, clock, tx, rx, local)
    rows, columns, coa = _directions(image, aperture, scp, (order, directions), words)
    places = _polynomials.nodes(*_corners(order, (rows.spacing, columns.spacing)))
    delay = (np.linalg.norm(tx - scp, axis=1) + np.linalg.norm(rx - scp, axis=1)) / SPEED_OF_LIGHT
    return Product(
        order=order,
        scp=scp,
        directions=(rows, columns),
        time_coa=coa,
        tracks=tracks,
        start=words.start() + np.timedelta64(shift, "s"),
        duration=float((time - shift + delay).max()),
        processed=(float(clock.min()), float(clock.max())),
        band=(float(aperture.low.min()), float(aperture.high.max())),
        polarization=_polarization(raw, words),
        names=names,
        gain=None if isinstance(image.gain, np.ndarray) else image.gain,
        window=image.window,
        backscatter=_backscatter(image, aperture, scp, directions, places),
        version=release,
    )


def words_of(raw: PhaseHistory, metadata: Mapping[str, ArrayLike | np.datetime64] | None) -> Words:
    """What metadata= gives; names that it does not give are those of the CPHD file that the echoes were read from.

    ValueError for a name that is missing, before an image is made.
    """
    known = (*REQUIRED, *OPTIONAL, *OTHERS)
    words = Words("SICD", metadata, known, {k: v for k, v in names_of(raw.metadata).items() if k in known})
    for key in REQUIRED:
        words.text(key)
    validation.choice("metadata['ModeType']", words.values["ModeType"], MODES)
    words.start()
    for key in ("AzAutofocus", "RgAutofocus"):
        if key in words.values:
            validation.choice(f"metadata[{key!r}]", words.values[key], ("NO", "GLOBAL", "SV"))
    _polarization(raw, words)
    return words


def check(image: Image, raw: PhaseHistory, has_beam: bool = False) -> None:
    """Raises, before an image is made, what `product_of` would without arguments, as far as it is known.

    image  of any pixels, on the grid;  has_beam  not all rows see all pixels
    """
    _check_image(image)
    sarkit_module("sicd")
    words_of(raw, None)
    frame(raw.tx[0], "SICD", None, None)
    if not has_beam:
        product_of(image, collection=raw)


def _check_image(image: Image) -> None:
    """ValueError for an image that SICD cannot hold."""
    if image.report is not None and image.report.plan.get("method") == "polar format":
        raise ValueError(
            "polar_format takes wavefronts for planes: its image has another spectrum and shows points beside their "
            "pixels, which the metadata would deny; use backproject"
        )
    if not image.grid.is_plane:
        raise ValueError(
            "SICD holds images on a plane, and this grid lists its points; focus on ImageGrid.plane, or save it as .h5"
        )
    if min(image.shape) < 2:
        raise ValueError(f"SICD holds images of two rows and columns or more, and this one has {image.shape}")
    if not image.is_complex:
        raise ValueError("SICD holds complex images, and this one is real (multilooked); save it before, or as .h5")


def _corners(order: Order, spacing: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest image coordinates, m (2,), of the file's pixels."""
    low = -np.array(order.scp_pixel) * spacing
    return low, low + (np.array(order.shape) - 1) * spacing


def _windows(image: Image) -> tuple[str, str]:
    """Windows over the frequencies and over the rows, in words."""
    across, _, along = (image.window or "none").partition(" x ")
    return across, along or across


def _backscatter(
    image: Image, aperture: Aperture, scp: np.ndarray, axes: np.ndarray, places: tuple[np.ndarray, np.ndarray]
) -> np.ndarray | None:
    """1/(gain^2 cell area), a polynomial by image coordinates: power of a pixel times it is a backscatter coefficient.

    None where the gain is not known, varies or is that of rows that saw parts of the image, or the window has no name.
    """
    if isinstance(image.gain, np.ndarray) or image.gain == UNKNOWN or image.aperture is not None:
        return None
    try:
        values = [1 / (image.gain**2 * aperture.cells(scp + p @ axes, axes, _windows(image))) for p in places]
    except (ValueError, IndexError, TypeError):  # a window without a name
        return None
    if not all(np.isfinite(each).all() for each in values):
        return None
    known = {id(p): each for p, each in zip(places, values, strict=True)}
    fit, error = _polynomials.surface(places, lambda p: known[id(p)], FIT[0] * float(values[0].min()))
    return fit if error <= FIT[1] * values[0].min() else None


def _check_gain(image: Image, raw: PhaseHistory) -> None:
    """ValueError where the gain of an image is not the sum of the weights of the echoes."""
    if isinstance(image.gain, np.ndarray) or image.gain == UNKNOWN:
        return
    across, along = _windows(image)
    try:
        rows, samples = window_weights(along, raw.n_rows), window_weights(across, raw.n_samples)
    except (ValueError, IndexError, TypeError):  # a window without a name
        return
    weight = 1.0 if raw.weight is None else raw.weight
    total = float((weight * rows).sum() * samples.sum())
    if abs(image.gain - total) > (GAIN if image.window else 1e-6) * total:
        raise ValueError(
            f"image.gain is {image.gain:g}, and {raw.n_rows} rows of {raw.n_samples} samples of collection have "
            f"{total:g}; give the phase history that the image was made of, with all of its rows"
        )


def _check_collection(image: Image, raw: PhaseHistory) -> None:
    """ValueError where an image was certainly made of other echoes."""
    middle = raw.n_rows // 2
    half = raw.frequency_step / 2
    band = (raw.frequency - half).min(), (raw.frequency + (raw.n_samples - 1) * raw.frequency_step + half).max()
    pairs = [("tx", image.tx, raw.tx[middle]), ("rx", image.rx, raw.rx[middle]), ("band", image.band, np.array(band))]
    if raw.time is not None:
        pairs.append(("time", image.time, np.array([raw.time.min(), raw.time.max()])))
    for name, one, other in pairs:
        if one is not None and not np.allclose(one, other, rtol=1e-9, atol=1e-3):
            raise ValueError(
                f"image.{name} is {one}, and collection has {other}; give the phase history that the "
                "image was made of, with the same rows and samples"
            )
    _check_gain(image, raw)


def _tracks(
    raw: PhaseHistory, time: np.ndarray, tx: np.ndarray, rx: np.ndarray, scp: np.ndarray
) -> tuple[np.ndarray, Tracks]:
    """Times of the rows by the file's clock, s, and the tracks of the antennas; ValueError where none fits.

    A pulse is on its way at three times: sent, at the scene, received. SICD's clock is at the scene. Antennas that rest
    while it is on its way (receiver where the sender is) are where they are at the time of sending.
    """
    out, back = (np.linalg.norm(end - scp, axis=1) for end in (tx, rx))
    sender, _ = _polynomials.track(time, tx)
    received = time + (out + back) / SPEED_OF_LIGHT
    is_monostatic = raw.is_monostatic or bool(
        (np.linalg.norm(_polynomials.at(sender, received) - rx, axis=1) < SAME).all()
    )
    clock = time if raw.is_monostatic else time + out / SPEED_OF_LIGHT
    if is_monostatic:
        middle = (tx + rx) / 2
        wanted = {"arp": (clock, middle)}
    else:  # the equivalent antenna: on the bisector, at the mean range
        bisector = (tx - scp) / out[:, None] + (rx - scp) / back[:, None]
        length = np.linalg.norm(bisector, axis=1)
        if length.min() < 1e-3:
            raise ValueError("sender and receiver lie on opposite sides of the scene, where range has no direction")
        middle = scp + bisector * ((out + back) / 2 / length)[:, None]
        wanted = {"arp": (clock, middle), "tx": (time, tx), "rx": (received, rx)}
    fits = {}
    for name, (times, positions) in wanted.items():
        fits[name], error = _polynomials.track(times, positions)
        if error > FARTHEST:
            raise ValueError(
                f"the track is {error:.2g} m from any polynomial of degree 8 in time, and SICD holds no other tracks; "
                f"at most {FARTHEST} m are allowed: save a shorter part of it"
            )
    if len(fits["arp"]) < 2:
        raise ValueError("the antenna rests: SICD needs the track of a moving one, of at least two pulses")
    return clock, Tracks(**fits)


def _order(image: Image, local: np.ndarray, scp: np.ndarray, antenna: np.ndarray) -> tuple[Order, np.ndarray]:
    """How the pixels are turned, and unit vectors along rows and columns of the file (2, 3), Earth-fixed.

    SICD wants rows that lead away from the antenna, and a normal (row x column) that points up.
    """
    grid, shape = image.grid, (image.shape[0], image.shape[1])
    assert grid.x_axis is not None and grid.y_axis is not None
    y_axis, x_axis = grid.y_axis @ local, grid.x_axis @ local
    longitude, latitude, _ = (float(v) for v in wgs84.geodetic(scp))
    up, away = wgs84.up(longitude, latitude), scp - antenna
    is_below = bool(np.cross(y_axis, x_axis) @ up < 0)  # row x column, before any turn
    best, most = (Order(shape, False, (False, False)), np.stack([y_axis, x_axis])), -np.inf
    for is_transposed in (False, True):
        for is_row_reversed in (False, True):
            # a transposition and every reversal turn the normal round
            is_column_reversed = is_below ^ is_transposed ^ is_row_reversed
            pair = np.stack([x_axis, y_axis] if is_transposed else [y_axis, x_axis])
            pair = pair * [[-1.0 if is_row_reversed else 1.0], [-1.0 if is_column_reversed else 1.0]]
            if pair[0] @ away > most:
                most = float(pair[0] @ away)
                best = Order(shape, is_transposed, (is_row_reversed, is_column_reversed)), pair
    return best


def _aperture(
    image: Image, raw: PhaseHistory, clock: np.ndarray, tx: np.ndarray, rx: np.ndarray, local: np.ndarray
) -> Aperture:
    """Rows of the echoes, spread over all, with their beams and range windows where the image has them."""
    rows = spread_over(raw.n_rows, MOST_ROWS)
    half = raw.frequency_step[rows] / 2
    low = raw.frequency[rows] - half
    beam, cosine, near, far = np.zeros((len(rows), 3)), -1.0, np.full(len(rows), -np.inf), np.full(len(rows), np.inf)
    if image.aperture is not None:
        table = image.aperture
        places = spread_over(raw.n_rows, len(table))
        if len(places) != len(table) or not np.allclose(raw.tx[places], table[:, :3], rtol=0, atol=1e-3):
            raise ValueError("image.aperture has other rows than collection; give the echoes that the image is made of")
        columns = [np.interp(rows, places, column) for column in table[:, 6:12].T]
        beam, cosine = np.stack(columns[:3], axis=1) @ local, float(table[0, 9])
        reach = SPEED_OF_LIGHT / (4 * raw.frequency_step[rows])
        if np.abs(table[:, 10:12]).max() < 1e20:  # the image has range windows
            near, far = raw.reference_range[rows] - reach, raw.reference_range[rows] + reach
    high = low + 2 * half * raw.n_samples
    return Aperture(clock[rows], tx[rows], rx[rows], low, high, beam, cosine, near, far)


def _directions(
    image: Image, aperture: Aperture, scp: np.ndarray, turned: tuple[Order, np.ndarray], words: Words
) -> tuple[Direction, Direction, np.ndarray]:
    """What the file says of rows and of columns, and the time at which a pixel is seen, by image coordinates."""
    order, axes = turned
    assert image.grid.spacing is not None
    spacing = image.grid.spacing[::-1] if order.is_transposed else image.grid.spacing
    places = _polynomials.nodes(*_corners(order, spacing))
    spans = {id(p): aperture.spans(scp + p @ axes, axes) for p in places}
    every = np.concatenate(list(spans.values()))
    if np.isnan(every).any():
        raise ValueError(
            "no pulse sees some part of the image, where it has no spectrum; save the part that is seen, such as "
            "image[100:200, 50:300]"
        )
    sizes = np.ptp(every, axis=-1)
    largest = sizes.max(axis=0)
    at_scp = aperture.spans(scp[None], axes)[0].mean(axis=-1)
    response = words.values.get("ImpRespWid")
    if response is not None:
        widths = validation.array("metadata['ImpRespWid']", response, np.float64, (2,))
    else:
        widths = _widths(image, aperture, scp, axes)
    out = []
    for i, name in enumerate(("rows", "columns")):
        bandwidth, step = float(largest[i]), float(spacing[i])
        if bandwidth * step > 1:
            raise ValueError(
                f"{name} of the file are {step:g} m apart, and the image has {bandwidth:g} cycles per metre across "
                f"them: SICD wants at most {1 / bandwidth:g} m; focus on a finer grid"
            )
        if sizes[:, i].min() < LEAST_SHARE * bandwidth:
            raise ValueError(
                f"the bandwidth across {name} is {sizes[:, i].min():g} to {bandwidth:g} cycles per metre, and SICD has "
                "one for all pixels; save a smaller part, such as image[100:200, 50:300]"
            )
        # quarters of a cycle per pixel, so that no pixel is rounded
        center = float(np.rint(4 * at_scp[i] * step)) / (4 * step)
        offset = _fit(places, lambda p, i=i, c=center: spans[id(p)][:, i].mean(axis=-1) - c, bandwidth, name)
        out.append(Direction(axes[i], step, float(widths[i]), bandwidth, center, offset))
    dwell = max(float(largest[2]), 1e-9)
    coa = _fit(places, lambda p: spans[id(p)][:, 2].mean(axis=-1), dwell, "times")
    return out[0], out[1], coa


def _fit(
    places: tuple[np.ndarray, np.ndarray], values: Callable[..., np.ndarray], scale: float, what: str
) -> np.ndarray:
    """A polynomial over the image; ValueError where none is near enough."""
    fit, error = _polynomials.surface(places, values, FIT[0] * scale)
    if error > FIT[1] * scale:
        raise ValueError(
            f"the middle of the spectrum across the image ({what}) is no polynomial of degree 5: it misses by "
            f"{error / scale:.0%} of its width; save a smaller part, such as image[100:200, 50:300]"
        )
    return fit


def _widths(image: Image, aperture: Aperture, scp: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Half-power widths of a point response at the centre, m (2,), along rows and columns."""
    try:
        return aperture.widths(scp, axes, _windows(image))
    except (ValueError, IndexError, TypeError) as exc:
        raise ValueError(
            f"the width of a point response with the window {image.window!r} is not known ({exc}); give "
            "metadata={'ImpRespWid': (along rows, along columns)}, m"
        ) from None


def _polarization(raw: PhaseHistory, words: Words) -> tuple[str, str]:
    """Names of the polarisations that were sent and received. ValueError for several, or for one that is not known."""
    letters = POLARIZATIONS | LATER
    if raw.polarization is None:
        pair = words.text("TxPol"), words.text("RcvPol")
    else:
        kinds = sorted(set(raw.polarization.tolist()))
        if len(kinds) > 1:
            raise ValueError(f"the echoes have polarizations {', '.join(kinds)}, and SICD one; use raw.select(...)")
        pair = tuple(letters.get(letter, letter) for letter in kinds[0])
    if len(pair) != 2 or not set(pair) <= set(letters.values()):
        raise ValueError(f"polarization {':'.join(pair)!r} is not one of SICD, two of {', '.join(letters.values())}")
    return pair
