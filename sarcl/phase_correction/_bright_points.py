"""Bright points of an image, and the contribution of each row to them: v_p(x), the terms of the image equation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..base.constants import SPEED_OF_LIGHT
from ..base.rows import groups
from ..base.threads import of_each
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..numerics import range_profiles, windows
from ..numerics.pulse_geometry import half_path
from ..opencl import fft

CANDIDATES = 50_000  # brightest pixels from which points are chosen
OVERSAMPLE = 8  # oversampling of profiles read linearly: an error of 0.6 %, different at each point
ROWS = 64  # rows whose profiles are made together: bounds the memory
PAD = 2  # samples of a profile that repeat its other end
VALUES = 2**15  # per array operation: they fit in a processor's cache
Beam = tuple[float, np.ndarray]  # full angle, rad, and a unit vector per row (n_rows, 3): the cone that it sees


def in_pulses(raw: PhaseHistory) -> np.ndarray:
    """Rows by pulse and channel, (n_pulses, n_channels), pulses in order of time.

    Rows of equal time are one pulse; without times, rows with equal antenna positions, in the order in which
    they come. A channel is a (tx_channel, rx_channel, polarization). Raises ValueError where a pulse has a channel
    twice, or lacks a channel of other pulses.
    """
    key = np.concatenate([raw.tx, raw.rx], axis=1) if raw.time is None else raw.time[:, None]
    _, first, pulse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    pulse = pulse.ravel()
    if raw.time is None:
        pulse = np.argsort(np.argsort(first))[pulse]
    channel = groups(raw.n_rows, raw.tx_channel, raw.rx_channel, raw.polarization)
    rows = np.full((pulse.max() + 1, channel.max() + 1), -1)
    for row in range(raw.n_rows):
        place = pulse[row], channel[row]
        if rows[place] >= 0:
            what = "equal antenna positions and no time" if raw.time is None else f"time {raw.time[row]:.9g} s"
            raise ValueError(
                f"rows {rows[place]} and {row} have {what}, and the same channel and polarization; give every pulse "
                "its own time, or name the channels"
            )
        rows[place] = row
    if (rows < 0).any():
        pulse_at, channel_at = (int(i) for i in np.argwhere(rows < 0)[0])
        present_row = rows[:, channel_at].max()
        names = {"tx_channel": raw.tx_channel, "rx_channel": raw.rx_channel, "polarization": raw.polarization}
        lacking = ", ".join(f"{k} {v[present_row]}" for k, v in names.items() if v is not None)
        raise ValueError(
            f"pulse {pulse_at} has no row of {lacking}, other pulses have; autofocus estimates one phase per pulse "
            "from all its channels: choose rows that every pulse has, with raw.select(...)"
        )
    return rows


def energy(raw: PhaseHistory) -> np.ndarray:
    """Weighted energy of every row's samples, (n_rows,) float64."""
    out = np.empty(raw.n_rows)
    for start in range(0, raw.n_rows, ROWS):
        stop = min(start + ROWS, raw.n_rows)
        out[start:stop] = (np.abs(raw.read(start, stop)).astype(np.float64) ** 2).sum(axis=1)
    return out if raw.weight is None else out * raw.weight**2


def delay(raw: PhaseHistory, row: int, places: np.ndarray) -> np.ndarray:
    """Delays tau - tau_ref of one row at places, m (n, 3): s (n,)."""
    tx = raw.tx[row]
    rx = tx if raw.is_monostatic else raw.rx[row]
    return 2 * (half_path(tx, rx, places) - raw.reference_range[row]) / SPEED_OF_LIGHT


def pixels(power: np.ndarray, grid: ImageGrid, most: int) -> np.ndarray:
    """Positions, m (n, 3), of the `most` brightest pixels, brightest first, none with power 0; power  of grid.shape."""
    return pixels_and_levels(power, grid, most)[0]


def pixels_and_levels(power: np.ndarray, grid: ImageGrid, most: int) -> tuple[np.ndarray, np.ndarray]:
    """`pixels`, and their power (n,)."""
    flat = power.ravel()
    count = min(most, flat.size)
    chosen = np.argpartition(flat, flat.size - count)[flat.size - count :]
    chosen = chosen[flat[chosen] > 0]
    chosen = chosen[np.argsort(-flat[chosen], kind="stable")]
    return np.asarray(grid.positions_of(np.unravel_index(chosen, grid.shape))), flat[chosen]


def brightest(raw: PhaseHistory, power: np.ndarray, grid: ImageGrid, width: float, most: int) -> np.ndarray:
    """Up to `most` points, m (n, 3): the brightest pixels, no two within one range cell and `width` Doppler cells.

    power  of the image, of grid.shape. Range cells: the delay at mid-aperture times the bandwidth. Doppler cells:
    cycles of the carrier between the first row and the last. Both follow from the geometry alone.
    """
    places = pixels(power, grid, CANDIDATES)
    first, middle, last = (delay(raw, row, places) for row in (0, raw.n_rows // 2, raw.n_rows - 1))
    cells = np.stack([middle * raw.bandwidth[0], (last - first) * raw.center_frequency[0] / width], axis=1)
    boxes = np.floor(cells).astype(np.int64)
    names = boxes @ np.array([2**32, 1])
    taken: dict[tuple[int, int], np.ndarray] = {}
    kept: list[int] = []
    # the brightest of each box, unless a brighter one in a neighbouring box lies within a cell of it
    for i in np.sort(np.unique(names, return_index=True)[1]):
        a, b = (int(x) for x in boxes[i])
        around = [taken.get((a + da, b + db)) for da in (-1, 0, 1) for db in (-1, 0, 1)]
        if all(other is None or (np.abs(other - cells[i]) >= (1, 0.5)).any() for other in around):
            taken[a, b] = cells[i]
            kept.append(int(i))
            if len(kept) == most:
                break
    return np.asarray(places[kept])


def phasor(cycles: np.ndarray) -> np.ndarray:
    """exp(+j 2 pi cycles), complex64, of cycles in float64: what is left of a turn is rounded to float32."""
    angle = (2 * np.pi * (cycles - np.rint(cycles))).astype(np.float32)
    phasors = np.empty(angle.shape, np.complex64)
    np.cos(angle, out=phasors.real)
    np.sin(angle, out=phasors.imag)
    return phasors


def contributions(
    raw: PhaseHistory, places: np.ndarray, lags: ArrayLike, scale: float, taper: bool = False, beam: Beam | None = None
) -> np.ndarray:
    """v_p(x)/scale at points x, m (n, 3), and at lags behind them in range: complex64 (n_rows, n, n_lags).

    lags  cells of c/(2 bandwidth) behind x at which the range profile is read, with the carrier phase of x itself
    taper  True: the samples have a Hamming window
    beam   a row contributes to places in its beam alone
    """
    n_rows, n_samples = raw.n_rows, raw.n_samples
    length = fft.good_length(OVERSAMPLE * n_samples)
    lags = np.asarray(lags, np.float64)
    out = np.zeros((n_rows, len(places), len(lags)), np.complex64)
    weight = np.ones(n_rows) if raw.weight is None else raw.weight
    few = int(np.clip(VALUES // max(len(places) * len(lags), 1), 1, ROWS))
    for start in range(0, n_rows, ROWS):
        stop = min(start + ROWS, n_rows)
        samples = raw.read(start, stop)
        if taper:
            samples = samples * windows.weights("hamming", n_samples).astype(np.float32)
        profiles = range_profiles.from_samples(None, samples, weight[start:stop, None] / scale, length, PAD)

        def fill(first: int, start: int = start, stop: int = stop, profiles: np.ndarray = profiles) -> None:
            rows = np.arange(first, min(first + few, stop))
            pulses = slice(rows[0], rows[-1] + 1)
            if beam is None:
                out[pulses] = _read(raw, rows, places, lags, profiles[rows - start], length)
                return
            is_seen = _sees(raw.tx[rows], places, (beam[0], beam[1][rows]))
            lit = np.flatnonzero(is_seen.any(axis=0))
            terms = _read(raw, rows, places[lit], lags, profiles[rows - start], length)
            out[pulses, lit] = terms * is_seen[:, lit, None]

        of_each(fill, range(start, stop, few))
    return out


def _sees(tx: np.ndarray, places: np.ndarray, beam: Beam) -> np.ndarray:
    """Whether places, m (n, 3), lie in the beams of rows at tx, m (k, 3): bool (k, n)."""
    along = sum((places[:, axis] - tx[:, axis, None]) * beam[1][:, axis, None] for axis in range(3))
    return np.asarray(along >= np.cos(beam[0] / 2) * _distances(tx, places))


def _distances(ends: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Distances (k, n), m, of places, m (n, 3), from antennas, m (k, 3)."""
    total = (places[:, 0] - ends[:, 0, None]) ** 2
    for axis in (1, 2):
        total += (places[:, axis] - ends[:, axis, None]) ** 2
    return np.asarray(np.sqrt(total, out=total))


def _read(
    raw: PhaseHistory, rows: np.ndarray, places: np.ndarray, lags: np.ndarray, profiles: np.ndarray, length: int
) -> np.ndarray:
    """The terms of the image equation (k, n, n_lags) of a few rows, whose profiles (k, length + 2 PAD) are given."""
    path = _distances(raw.tx[rows], places)
    if not raw.is_monostatic:
        path = (path + _distances(raw.rx[rows], places)) / 2
    late = 2 * (path - raw.reference_range[rows, None]) / SPEED_OF_LIGHT
    turns = (late * raw.frequency_step[rows, None])[:, :, None] + lags / raw.n_samples
    position = (turns - np.floor(turns)) * length
    before = position.astype(np.int64)
    after = (position - before).astype(np.float32)
    before += (PAD + profiles.shape[1] * np.arange(len(rows)))[:, None, None]
    flat = profiles.ravel()
    read = flat[before]
    before += 1
    read += (flat[before] - read) * after
    read *= np.abs(turns) <= 0.5
    carrier = raw.frequency[rows] + raw.n_samples // 2 * raw.frequency_step[rows]
    read *= phasor(carrier[:, None] * late)[:, :, None]
    return read
