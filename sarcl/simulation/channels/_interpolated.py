"""Channels of an array, interpolated between echoes from few places of it where that is cheaper.

A run of the engines at a place takes the whole band. Less the path to the scene's centre, its samples are interpolated
to every element, which turns them back by its own path, in extended precision. Scatterers are visited once a place, not
once a channel: 450 elements in front of a small scene are a handful of places, 450 by 450 some twenty.
"""

from __future__ import annotations

import numpy as np

from ...arrays.channels import Channel
from ...base.boxes import corners
from ...base.constants import SPEED_OF_LIGHT
from ...numerics import cost_model
from ...scattering.antenna_weights import Beam
from ...scene.scene import Scene
from ..scene_echoes import Work, band_of
from ..spreading import Band
from ._chebyshev_positions import Places, places_of
from ._response_samples import Views
from ._separate import Layout, during, run
from .channel_rows import antennas_of

SHARE = 0.3  # of the tolerance, for what is interpolated
FAR = 0.02  # of the distance: no array larger than this is looked at
GRAZING = 0.3  # of the tolerance: facets that face some elements alone are about (array/distance)^1.5 of the echo
BLOCK = 256  # pulses whose paths are made at a time


class Between:
    """The places of an array that stand for its senders and for its receivers.

    tx, rx     Places; a place of `tx` is both where every element hears its own channel
    error      of what is interpolated, relative;  tolerance  what is left for echoes at the places
    runs       pulses at all places
    """

    def __init__(self, layout: Layout, scene: Scene, weights: Beam, vertical: np.ndarray, tolerance: float) -> None:
        rows, self.layout, self.center = layout.rows, layout, scene.center
        self.own = rows.receive == "own"
        # + 0.0: so that 0 and -0 are one place
        self.senders, index = np.unique(np.array([c.offset for c in layout.sent]) + 0.0, axis=0, return_inverse=True)
        self.sender = dict(zip(map(id, layout.sent), index.ravel().tolist(), strict=True))
        self.heard = self.senders if self.own else rows.heard
        # errors add up where channels do, the more so where their sum is small
        together = float(np.sqrt(layout.overlap))
        self.tx, self.rx = Places(self.senders), Places(np.zeros((1, 3)) if self.own else self.heard)
        if self._fits(scene, vertical, tolerance):
            grid = layout.grid
            views = Views(rows.sides, scene, weights, grid.frequency + grid.n * grid.step, self.senders, self.heard)
            allowed, most = SHARE * tolerance / together, self._most(len(scene.positions) + len(scene.triangles))
            least = 2 if len(scene.triangles) else 1  # what facets send back changes evenly from place to place
            if self.own:
                self.tx = places_of(self.senders, views.same, allowed, most, least)
            else:
                self.tx = places_of(self.senders, views.sending, allowed / 2, most, least)
                within = allowed / 2 / self.tx.growth
                self.rx = places_of(self.heard, views.hearing, within, most / len(self.tx), least)
        self.growth = together * self.tx.growth * self.rx.growth
        self.error = together * (self.tx.error + self.tx.growth * self.rx.error)
        self.tolerance = (tolerance - self.error) / self.growth
        self.runs = len(self.tx) * len(self.rx) * len(rows.sides.tx)

    @property
    def interpolates(self) -> bool:
        """Whether there are fewer places than elements, on either side."""
        return self.tx.basis is not None or self.rx.basis is not None

    def _most(self, scatterers: int) -> float:
        """Places that cost no more than every channel apart."""
        layout, fixed = self.layout, cost_model.CHANNEL_RUN + cost_model.CHANNEL_SCATTERER * scatterers
        width = min(layout.grid.width, layout.grid.n)
        sample, between = cost_model.CHANNEL_SAMPLE, cost_model.CHANNEL_INTERPOLATED
        saved = layout.runs * (cost_model.INTERPOLATION_PAYS * (fixed + sample * width) - between * width)
        return saved / (len(layout.rows.sides.tx) * (fixed + sample * layout.grid.n))

    def pays(self, scatterers: int) -> bool:
        """Whether this is quicker than every channel apart."""
        return self.interpolates and len(self.tx) * len(self.rx) <= self._most(scatterers)

    def _fits(self, scene: Scene, vertical: np.ndarray, tolerance: float) -> bool:
        """Whether echoes are smooth over the array: antennas far off, no scatterer at an edge of the range window.

        Paths are convex in the places of scatterers and elements: largest at corners of their boxes, and inside no
        further below what they are there than `bow`; to the reference, where it moves with the element, the other way.
        """
        layout, rows, sides = self.layout, self.layout.rows, self.layout.rows.sides
        radius = float(np.linalg.norm(np.ptp(scene.bounds, axis=0))) / 2
        places = [self.senders, self.heard]
        wide = max(float(np.linalg.norm(np.ptp(p, axis=0))) for p in places)
        reach = max(float(np.linalg.norm(p, axis=1).max()) for p in places)
        antennas = (sides.tx, sides.rx)
        near, near_point = (
            min(float(np.linalg.norm(e - point, axis=1).min()) for e in antennas) - reach
            for point in (self.center, rows.point)
        )
        near -= radius
        if wide > FAR * near or (wide and near_point < 4 * wide):
            return False
        if len(scene.triangles) and not self._facets_alike(wide / near, vertical, tolerance):
            return False
        bow = 2 * (radius + wide) ** 2 / near
        over = wide**2 / near_point if wide else 0.0
        alias = 0.98 * SPEED_OF_LIGHT / (4 * layout.grid.step)
        ends = [corners(np.stack([p.min(axis=0), p.max(axis=0)])) for p in places]
        for start in range(0, len(sides.tx), BLOCK):
            at = slice(start, start + BLOCK)
            tx, rx = sides.senders(ends[0], at), sides.receivers(ends[1], at)
            sent, heard = (_paths(e, corners(scene.bounds)) for e in (tx, rx))
            sender = tx if rows.separated else sides.tx[at][:, None]
            for point, first, last, room in (
                (rows.point, sender, layout.window, over),
                (self.center, tx, (-alias, alias), wide**2 / near),
            ):
                low, high = 0.0, 0.0
                for paths, others in ((sent, first), (heard, rx)):
                    off = paths - _paths(others, point[None])
                    low, high = low + off.min(axis=1) / 2, high + off.max(axis=1) / 2
                if np.min(low) - bow < last[0] or np.max(high) + room > last[1]:
                    return False
        return True

    def _facets_alike(self, angle: float, vertical: np.ndarray, tolerance: float) -> bool:
        """Whether facets that face one element face all, and H and V lie alike there: angle, rad, of the array."""
        sides = self.layout.rows.sides
        look = sides.tx - self.center
        off_vertical = np.linalg.norm(np.cross(look / np.linalg.norm(look, axis=1, keepdims=True), vertical), axis=1)
        turned = angle / max(float(off_vertical.min()), 1e-12)
        return sides.rx is sides.tx and max(angle**1.5, turned**2) <= GRAZING * tolerance

    @property
    def bands(self) -> list[Band]:
        """Of every run: the whole band."""
        return [self.layout.band(self._frequencies)]

    @property
    def _frequencies(self) -> np.ndarray:
        grid = self.layout.grid
        return np.asarray(grid.frequency + grid.step * np.arange(grid.n))

    def pulses(self, budget: float) -> int:
        """Pulses to be filled at a time: what is made at the places, and of a channel, takes half the budget."""
        rows, grid = self.layout.rows, self.layout.grid
        names = len(rows.polarizations)
        at_places = 8 * len(self.tx) * len(self.rx) * names * grid.n
        channel = rows.hearing * (min(grid.width, grid.n) * (48 + 24 * names) + 100)
        return max(1, int(budget / 2 / (at_places + channel)))

    def fill(self, work: Work, samples: np.ndarray, start: int, total: int) -> float:
        """As `Apart.fill`."""
        grid, sides, worst = self.layout.grid, self.layout.rows.sides, 0.0
        at = slice(start, start + len(samples))
        frequencies = self._frequencies
        band = band_of(self.layout.waveform, float(frequencies.mean()), grid.n * grid.step)
        reach = SPEED_OF_LIGHT / (4 * grid.step)
        made = np.empty((len(self.tx), len(self.rx), len(samples), samples.shape[3], grid.n), np.complex64)
        for i, j in np.ndindex(made.shape[:2]):
            tx = sides.senders(self.tx.at[i], at)
            rx = sides.receivers(self.tx.at[i] if self.own else self.rx.at[j], at)
            path = _length(tx, self.center) + _length(rx, self.center)
            reference = np.asarray(path / 2, np.float64)
            antennas = antennas_of(tx, rx, reference, float(frequencies[0]), grid, (-reach, reach))
            made[i, j] = run(work, antennas, band, frequencies, start, total)
            worst = max(worst, work.predicted_error)
            rounded = np.asarray(path - 2 * reference, np.float64)
            if np.abs(rounded).max() * frequencies[-1] > 1e-9 * SPEED_OF_LIGHT:  # thousands of kilometres away
                made[i, j] *= _turn(-rounded, frequencies)[:, None]
        heard = None if self.own else self._heard(sides.receivers(self.layout.rows.heard, at))
        for channel, now, here in during(self.layout.sent, start, len(samples)):
            ears = heard or self._heard(sides.receivers(channel.offset[None], now))
            self._channel(work, channel, now, made[:, :, here], samples[here], *(e[here] if heard else e for e in ears))
        work.order.clock.lap("channels")
        return self.error + self.growth * worst

    def _heard(self, rx: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lengths from receivers (n, m, 3) to the scene's centre, in extended precision, and to the reference, m."""
        return _length(rx, self.center), np.linalg.norm(rx - self.layout.rows.point, axis=-1)

    def _channel(
        self, work: Work, channel: Channel, at: slice, made: np.ndarray, samples: np.ndarray, back: np.ndarray,
        back_to_reference: np.ndarray,
    ) -> None:  # fmt: skip
        """Add a channel at every receiver to samples of pulses `at`, from those made at the places."""
        layout, rows = self.layout, self.layout.rows
        part, frequencies = layout.samples(channel)
        number, part_of_band = self.sender[id(channel)], made[..., layout.grid.part(channel.carrier)]
        if self.tx.basis is None:
            some = part_of_band[number]
        else:
            some = np.tensordot(self.tx.basis[number].astype(np.float32), part_of_band, 1)
        every = some if self.rx.basis is None else np.tensordot(self.rx.basis.astype(np.float32), some, 1)
        values = np.moveaxis(every, 0, 1)
        tx = rows.sides.senders(channel.offset, at)
        sent_to_reference = np.linalg.norm((tx if rows.separated else rows.sides.tx[at]) - rows.point, axis=-1)
        reference = (sent_to_reference[:, None] + back_to_reference) / 2  # as `Rows.geometry` rounds it
        path = np.asarray(_length(tx, self.center)[:, None] + back - 2 * reference, np.float64)
        spectrum = layout.spectrum(channel, frequencies) * work.weights.factor(frequencies)
        values = values * (_turn(path, frequencies) * spectrum).astype(np.complex64)[:, :, None]
        rows.put(samples, channel, slice(None), part, values)

    def describe(self) -> dict[str, int]:
        """For a report."""
        return {"places": len(self.tx) * len(self.rx)}


def _paths(antennas: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Lengths from antennas (n, m, 3) to points (k, 3), m (n, m, k)."""
    return np.asarray(np.linalg.norm(antennas[..., None, :] - points, axis=-1))


def _length(antennas: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The same to one point, in extended precision."""
    d = antennas.astype(np.longdouble) - point
    return np.asarray(np.sqrt((d * d).sum(axis=-1)))


def _turn(path: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    """exp(-j 2 pi f path/c) of paths, m (...), at frequencies, Hz (n,): (..., n)."""
    turns = path[..., None] * (frequencies / SPEED_OF_LIGHT)
    return np.asarray(np.exp(-2j * np.pi * (turns - np.rint(turns))))
