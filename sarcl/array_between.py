"""Channels of an array, interpolated between echoes from few places of it (array_places.py) where that is cheaper.

A run of the engines at a place takes the whole band. Less the path to the scene's centre, its samples are interpolated
to every element, which turns them back by its own path, in extended precision. Scatterers are visited once a place, not
once a channel: 450 elements in front of a small scene are a dozen places, 450 by 450 a hundred.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .array_places import Extra, Places, places_of
from .array_rows import antennas_of
from .array_sum import Layout, during, run
from .channels import Channel
from .check import SPEED_OF_LIGHT
from .echo_work import Work, band_of
from .scene import Scene
from .triangles import corners

# Cost of a pulse in a run of the engines, of a sample of its band, of a scatterer in it: us on two cores (PoCL)
RUN, SAMPLE, SCATTERER = 15.0, 0.03, 0.003
WORTHWHILE = 0.7  # of what the channels cost apart
SHARE = 0.3  # of the tolerance, for what is interpolated
FAR = 0.02  # of the distance: from all over an array no larger than this, gains and facets look nearly the same
GRAZING = 0.3  # facets that some elements see and others do not are about (array/distance)^1.5 of the echo
LOOKED_AT = 33  # pulses along the track at which turns are looked at
BLOCK = 256  # pulses whose paths are made at a time


class Between:
    """The places of an array that stand for its senders and for its receivers.

    tx, rx     Places; a place of `tx` is both where every element hears its own channel
    error      of what is interpolated, relative;  tolerance  what is left for echoes at the places
    runs       pulses at all places
    """

    def __init__(self, layout: Layout, scene: Scene, tolerance: float) -> None:
        rows, self.layout, self.center = layout.rows, layout, scene.center
        self.own = rows.receive == "own"
        # + 0.0: so that 0 and -0 are one place
        self.senders, index = np.unique(np.array([c.offset for c in layout.sent]) + 0.0, axis=0, return_inverse=True)
        self.sender = dict(zip(map(id, layout.sent), index.ravel().tolist(), strict=True))
        allowed = SHARE * tolerance / np.sqrt(layout.overlap)
        sending, hearing = self._turns(scene)
        if self.own:
            self.tx = places_of(self.senders, lambda d: sending(d) + hearing(d), allowed)
            self.rx = Places(np.zeros((1, 3)), np.ones((1, 1)))
        else:
            self.tx = places_of(self.senders, sending, allowed / 2)
            self.rx = places_of(rows.heard, hearing, allowed / 2 / self.tx.growth)
        self.growth = float(np.sqrt(layout.overlap)) * self.tx.growth * self.rx.growth
        self.error = float(np.sqrt(layout.overlap)) * (self.tx.error + self.tx.growth * self.rx.error)
        self.tolerance = (tolerance - self.error) / self.growth
        self.runs = len(self.tx) * len(self.rx) * len(rows.sides.tx)

    def _turns(self, scene: Scene) -> tuple[Extra, Extra]:
        """How echoes of the scene's outermost places turn at places of senders and of receivers, less the centre's."""
        sides, grid = self.layout.rows.sides, self.layout.grid
        wave = (grid.frequency + grid.n * grid.step) / SPEED_OF_LIGHT
        off = corners(scene.bounds) - self.center
        off = np.concatenate([off, np.diag(off[-1]), -np.diag(off[-1])])  # the middles of faces: nearest to antennas

        def extra(ends: np.ndarray) -> np.ndarray:
            d = ends - self.center  # (pulses, places, 3)
            away = np.linalg.norm(d, axis=-1)[..., None]
            less = (off**2).sum(axis=1) - 2 * d @ off.T
            total = np.linalg.norm(d[..., None, :] - off, axis=-1) + away
            return np.asarray(wave * np.moveaxis(less / total, 1, 0).reshape(d.shape[1], -1))

        def widest(stand: Callable[..., np.ndarray], places: np.ndarray) -> np.ndarray:
            """Pulses spread along the track, and those at which the array's box turns echoes most."""
            box = corners(np.stack([places.min(axis=0), places.max(axis=0)]))
            n, turns = len(sides.tx), np.zeros(len(sides.tx))
            for start in range(0, n, BLOCK):
                here = slice(start, min(start + BLOCK, n))
                found = extra(stand(box, here)).reshape(len(box), -1, len(off))
                turns[here] = np.ptp(found, axis=0).max(axis=-1)
            spread = np.linspace(0, n - 1, LOOKED_AT).astype(int)
            return np.unique(np.concatenate([spread, np.argsort(turns)[-LOOKED_AT // 4 :]]))

        sending = widest(sides.senders, self.senders)
        hearing = widest(sides.receivers, self.senders if self.own else self.layout.rows.heard)
        if self.own:
            sending = hearing = np.union1d(sending, hearing)
        return (lambda d: extra(sides.senders(d, sending))), (lambda d: extra(sides.receivers(d, hearing)))

    def pays(self, scatterers: int) -> bool:
        """Whether this is quicker than every channel apart."""
        grid, fixed = self.layout.grid, RUN + SCATTERER * scatterers
        apart = self.layout.runs * (fixed + SAMPLE * min(grid.width, grid.n))
        return self.runs * (fixed + SAMPLE * grid.n) < WORTHWHILE * apart

    def fits(self, scene: Scene) -> bool:
        """Whether echoes are smooth over the array: antennas far off, no scatterer at an edge of the range window.

        Paths are convex in the places of scatterers and elements: largest at corners of their boxes, and inside
        no further below what they are there than `bow`.
        """
        layout, rows, sides = self.layout, self.layout.rows, self.layout.rows.sides
        monostatic = sides.rx is sides.tx
        radius = float(np.linalg.norm(np.ptp(scene.bounds, axis=0))) / 2
        places = [self.senders, self.senders if self.own else rows.heard]
        wide = max(float(np.linalg.norm(np.ptp(p, axis=0))) for p in places)
        reach = max(float(np.linalg.norm(p, axis=1).max()) for p in places)
        near = min(float(np.linalg.norm(e - self.center, axis=1).min()) for e in (sides.tx, sides.rx))
        near -= radius + reach
        if wide > FAR * near:
            return False
        if len(scene.triangles) and (not monostatic or (wide / near) ** 1.5 > GRAZING * self.tolerance):
            return False
        bow = 2 * (radius + wide) ** 2 / near
        alias = 0.98 * SPEED_OF_LIGHT / (4 * layout.grid.step)
        ends = [corners(np.stack([p.min(axis=0), p.max(axis=0)])) for p in places]
        for start in range(0, len(sides.tx), BLOCK):
            at = slice(start, start + BLOCK)
            tx, rx = sides.senders(ends[0], at), sides.receivers(ends[1], at)
            sent, heard = (_paths(e, corners(scene.bounds)) for e in (tx, rx))
            sender = tx if rows.separated else sides.tx[at][:, None]
            for point, first, last in ((rows.point, sender, layout.window), (self.center, tx, (-alias, alias))):
                low, high = 0.0, 0.0
                for paths, antennas in ((sent, first), (heard, rx)):
                    off = paths - _paths(antennas, point[None])
                    low, high = low + off.min(axis=1) / 2, high + off.max(axis=1) / 2
                if np.min(low) - bow < last[0] or np.max(high) > last[1]:
                    return False
        return True

    def pulses(self, budget: float) -> int:
        """Pulses to be filled at a time, so that what is made at the places takes half the budget."""
        places, names = self.runs // len(self.layout.rows.sides.tx), len(self.layout.rows.polarizations)
        return max(1, int(budget / 2 / (8 * places * names * self.layout.grid.n)))

    def fill(self, work: Work, samples: np.ndarray, start: int, total: int) -> float:
        """As `Apart.fill`."""
        grid, sides, worst = self.layout.grid, self.layout.rows.sides, 0.0
        at = slice(start, start + len(samples))
        frequencies = grid.frequency + grid.step * np.arange(grid.n)
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
        sender = self.tx.basis[self.sender[id(channel)]].astype(np.float32)
        some = np.tensordot(sender, made[..., layout.grid.part(channel.carrier)], 1)
        values = np.moveaxis(np.tensordot(self.rx.basis.astype(np.float32), some, 1), 0, 1)
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
