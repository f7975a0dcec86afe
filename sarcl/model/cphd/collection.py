"""A phase history as the collection of a CPHD file: Earth-fixed, with names and times; what is missing is refused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...base import validation, wgs84
from ...base.constants import SPEED_OF_LIGHT
from ...io.cphd.writing import OVERSAMPLING, ChannelRows, Collection
from .words import LATER, POLARIZATIONS, Words, frame, per_row

if TYPE_CHECKING:
    from ..phase_history import PhaseHistory

MODES = ("SPOTLIGHT", "STRIPMAP", "DYNAMIC STRIPMAP")
REQUIRED = ("CollectorName", "CoreName", "ModeType", "Classification", "ReleaseInfo")
OPTIONAL = ("IlluminatorName", "ModeID", "CountryCode", "CollectType")
OF_ROWS = {"time": "TxTime", "tx_velocity": "TxVel", "rx_velocity": "RcvVel"}  # names by fields of the echoes
OTHERS = ("CollectionStart", "TxPol", "RcvPol", "SRPPos", "ImageArea", *OF_ROWS.values())
STEPS, MET = 20, 1e-7  # iterations, and error in m, of the point at which reference ranges meet
SAME = 1.0  # m: farther from where the sender has moved on to, the receiver is on another platform


class CphdOptions(NamedTuple):
    """Arguments of `PhaseHistory.save` for CPHD, which has their defaults."""

    origin: ArrayLike | None
    axes: ArrayLike | None
    metadata: Mapping[str, ArrayLike | np.datetime64] | None
    domain: str
    sgn: int
    version: str
    kind: str = "CPHD"


def collection_of(raw: PhaseHistory, options: CphdOptions) -> Collection:
    """All that the file of a phase history says; ValueError for options that CPHD does not have."""
    validation.choice("domain", options.domain, ("FX", "TOA"))
    validation.choice("version", options.version, ("1.0.1", "1.1.0"))
    if options.sgn not in (-1, 1) or isinstance(options.sgn, bool):
        raise ValueError(f"sgn is {options.sgn!r}; give -1, or +1: then the samples are conjugated")
    _check_samples(raw, options.kind)
    of_rows = [key for name, key in OF_ROWS.items() if getattr(raw, name) is None]
    must, is_local = (*of_rows, *REQUIRED, "CollectionStart"), options.origin is not None
    words = Words(options.kind, options.metadata, (*REQUIRED, *OPTIONAL, *OTHERS), must=must)
    corner, local = frame(raw.tx[0], options.kind, options.origin, options.axes)
    time = per_row(raw, words, "time", OF_ROWS["time"], ())
    velocities = [per_row(raw, words, name, OF_ROWS[name], (3,)) @ local for name in ("tx_velocity", "rx_velocity")]
    tx, rx = (corner + positions @ local for positions in (raw.tx, raw.rx))
    point = _reference_point(raw, words, corner, local, is_local)
    early = max(0, int(np.ceil(-time.min())))  # whole seconds by which the file's clock starts before time 0
    start = words.start() - np.timedelta64(early, "s")
    names = {key: words.text(key) for key in REQUIRED} | {k: words.text(k) for k in OPTIONAL if k in words.values}
    validation.choice("metadata['ModeType']", names["ModeType"], MODES)
    delay = (np.linalg.norm(tx - point, axis=1) + np.linalg.norm(point - rx, axis=1)) / SPEED_OF_LIGHT
    moved = np.linalg.norm(rx - tx - velocities[0] * delay[:, None], axis=1)
    is_one = raw.is_monostatic or bool((moved < SAME).all())
    names.setdefault("CollectType", "MONOSTATIC" if is_one else "BISTATIC")
    validation.choice("metadata['CollectType']", names["CollectType"], ("MONOSTATIC", "BISTATIC"))
    surface, area = _surface(raw, words, point, local, is_local)
    return Collection(
        channels=_channels(raw, words, time, options.version),
        n_samples=raw.n_samples,
        frequency=raw.frequency,
        frequency_step=raw.frequency_step,
        reference_range=raw.reference_range,
        time=time + early,
        tx=tx,
        rx=rx,
        tx_velocity=velocities[0],
        rx_velocity=velocities[1],
        reference_point=point,
        surface=surface,
        area=area,
        start=start,
        names=names,
        domain=options.domain,
        sgn=int(options.sgn),
        version=options.version,
    )


def _check_samples(raw: PhaseHistory, kind: str) -> None:
    """ValueError for what a file of a kind cannot say of samples."""
    if not raw.compressed:
        raise ValueError(
            f"the echoes are not compressed, and {kind} is written of compressed ones; call sarcl.compress first"
        )
    if raw.weight is not None and not (raw.weight == 1).all():
        raise ValueError(
            f"weight differs from 1, which {kind} has no place for; give dataclasses.replace(raw, weight=None)"
        )
    if raw.array is not None and raw.tx_channel is None and (raw.array.positions.any() or raw.array.offsets.any()):
        raise ValueError(
            f"the rows are sums over the {raw.array.n} elements of an array, and a {kind} vector has one phase "
            "centre and one carrier; give sarcl.echo channels='separated', or save sarcl.map_aperture(raw, 'channels')"
        )


def _reference_point(
    raw: PhaseHistory, words: Words, corner: np.ndarray, local: np.ndarray, is_local: bool
) -> np.ndarray:
    """SRPPos, Earth-fixed, m (3,): given, or the centre of the image area, or on z = 0."""
    if words.values.get("SRPPos") is not None:
        return corner + validation.array("metadata['SRPPos']", words.values["SRPPos"], np.float64, (3,)) @ local
    if raw.image_area is not None:
        return np.asarray(corner + raw.image_area[0] @ local)
    if is_local:
        return np.asarray(corner + _meeting_point(raw) @ local)
    words.need("SRPPos", "Earth-fixed echoes have no reference point (m, in their coordinates, near the scene)")
    raise AssertionError


def _meeting_point(raw: PhaseHistory) -> np.ndarray:
    """The point of z = 0, m (3,), whose ranges are the reference ranges; the origin where there is none."""
    point = np.zeros(3)
    for _ in range(STEPS):
        to_tx, to_rx = point - raw.tx, point - raw.rx
        r_tx, r_rx = np.linalg.norm(to_tx, axis=1), np.linalg.norm(to_rx, axis=1)
        excess = (r_tx + r_rx) / 2 - raw.reference_range
        if np.abs(excess).max() < MET:
            return point
        gradient = (to_tx / r_tx[:, None] + to_rx / r_rx[:, None]) / 2
        point[:2] -= np.linalg.lstsq(gradient[:, :2], excess, rcond=None)[0]
    return np.zeros(3)


def _surface(
    raw: PhaseHistory, words: Words, point: np.ndarray, local: np.ndarray, is_local: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Axes (2, 3) of the plane of the scene through the reference point, and corners (2, 2) of its image area, m.

    The plane and extent of the echoes' image area; else x and y of local coordinates, or east and north, and the extent
    that the frequency step leaves unambiguous.
    """
    half = np.full(2, float(raw.swath.min()) / 2 / OVERSAMPLING)
    if raw.image_area is not None:
        sides = raw.image_area[1:] @ local
        half = np.linalg.norm(sides, axis=1)
        x_axis = sides[0] / half[0]
        y_axis = sides[1] - (sides[1] @ x_axis) * x_axis
        surface = np.stack([x_axis, y_axis / np.linalg.norm(y_axis)])
    elif is_local:
        surface = local[:2]
    else:
        longitude, latitude, _ = wgs84.geodetic(point)
        surface = wgs84.local_axes(float(longitude), float(latitude))[:2]
    area = np.stack([-half, half])
    if words.values.get("ImageArea") is not None:
        area = validation.array("metadata['ImageArea']", words.values["ImageArea"], np.float64, (2, 2))
        if not (area[0] < area[1]).all():
            raise ValueError(
                f"metadata['ImageArea'] is {area.tolist()}; give ((x1, y1), (x2, y2)), x1 < x2, y1 < y2, m"
            )
    return surface, area


def _channels(raw: PhaseHistory, words: Words, time: np.ndarray, version: str) -> tuple[ChannelRows, ...]:
    """Rows of equal transmitting and receiving channel, polarisation, and carrier of an array, in order; their times
    must increase.
    """
    letters = POLARIZATIONS | (LATER if version == "1.1.0" else {})
    if raw.polarization is None:
        pair = words.text("TxPol"), words.text("RcvPol")
        labels = np.full(raw.n_rows, ":".join(pair))
        names = {":".join(pair): pair}
        unknown = [name for name in pair if name not in letters.values()]
    else:
        labels = raw.polarization
        distinct = sorted(set(labels.tolist()))
        unknown = [label for label in distinct if len(label) != 2 or not set(label) <= set(letters)]
        names = {label: (letters[label[0]], letters[label[1]]) for label in distinct if label not in unknown}
    if unknown:
        raise ValueError(
            f"polarization {unknown[0]!r} is not one of CPHD {version}, two of {', '.join(letters.values())}"
        )
    zeros = np.zeros(raw.n_rows, int)
    tx, rx = (zeros if each is None else each for each in (raw.tx_channel, raw.rx_channel))
    # a plan gives an element other carriers from some pulse on; without an array rows may differ in each frequency
    carrier = np.zeros(raw.n_rows) if raw.array is None else raw.frequency
    rows_of: dict[tuple[int, int, str, float], list[int]] = {}
    for row, key in enumerate(zip(tx.tolist(), rx.tolist(), labels.tolist(), carrier.tolist(), strict=True)):
        rows_of.setdefault(key, []).append(row)
    channels = []
    for number, (key, members) in enumerate(rows_of.items()):
        rows = np.array(members)
        if not (np.diff(time[rows]) > 0).all():
            raise ValueError(
                f"times of the rows of channel {key[:3]} do not increase, as CPHD wants; sort the rows by time"
            )
        channels.append(ChannelRows(f"{number + 1}", names[key[2]], (key[0], key[1]), rows))
    return tuple(channels)
