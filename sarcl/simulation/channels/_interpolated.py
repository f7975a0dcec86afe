"""Channels of an array interpolated from echoes at a few positions in it, where that is cheaper than each by itself.

Echoes between two positions are computed over the whole band. Without the phase of the path to the scene's centre they
are interpolated to every element, and get the phase of that element's own path, in extended precision. Scatterers are
visited once per pair of positions, not once per channel: for a small scene a handful of positions suffices for 450
elements, and some twenty pairs of positions for 450 transmitting by 450 receiving elements.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...arrays.channels import Channel
from ...base.boxes import corners
from ...base.constants import SPEED_OF_LIGHT
from ...base.report import SMALLER_TOLERANCE, ErrorTerm, root_sum_square
from ...base.vectors import unit
from ...model.waveform import Waveform
from ...numerics import cost_model
from ...numerics.pulse_geometry import PulseGeometry
from ...scattering.antenna_weights import AntennaWeights
from ...scene.scene import Scene
from ..scene_echoes import Added, ChannelEchoes, SceneEchoes, band_of
from ..spreading import Band, most_pulses
from ._chebyshev_positions import Positions, choose_positions
from ._response_samples import ResponseSamples
from ._separate import ChannelLayout, active_channels, echoes_of

SHARE = 0.3  # of the tolerance, for the interpolation
FAR = 0.02  # of the distance: larger arrays are not interpolated
# of the tolerance: facets that only some elements can see contribute about (array/distance)^1.5 of the echo
GRAZING = 0.3
BLOCK = 256  # pulses per array operation: bounds the memory


class InterpolatedChannels:
    """Echoes of channels, interpolated from a few positions of transmitting and receiving elements.

    tx, rx     Positions; where elements receive their own channels, those of `tx` are both
    error      interpolation error, relative;  tolerance  what is left of it for the echoes at the positions
    runs       number of range profiles that are computed: pulses times pairs of positions
    """

    def __init__(
        self, layout: ChannelLayout, scene: Scene, weights: AntennaWeights, vertical: np.ndarray, tolerance: float
    ) -> None:
        rows, self.layout, self.center = layout.rows, layout, scene.center
        self.own = rows.receive == "own"
        # + 0.0: so that 0 and -0 are one position
        self.transmitters = np.unique(np.array([c.offset for c in layout.sent]) + 0.0, axis=0)
        self.receivers = self.transmitters if self.own else rows.receivers
        # errors of channels add up where the channels are summed
        sum_growth = float(np.sqrt(layout.overlap))
        self.tx = Positions(self.transmitters)
        self.rx = Positions(np.zeros((1, 3)) if self.own else self.receivers)
        if self._is_smooth(scene, vertical, tolerance):
            highest = layout.grid.frequency + layout.grid.n * layout.grid.step
            samples = ResponseSamples(rows, scene, weights, highest, self.transmitters, self.receivers)
            allowed, most = SHARE * tolerance / sum_growth, self._most(len(scene.positions) + len(scene.triangles))
            least = 2 if len(scene.triangles) else 1  # amplitudes of facets change linearly with position
            if self.own:
                self.tx = choose_positions(self.transmitters, samples.two_way_response, allowed, most, least)
            else:
                self.tx = choose_positions(self.transmitters, samples.tx_response, allowed / 2, most, least)
                within = allowed / 2 / self.tx.growth
                self.rx = choose_positions(self.receivers, samples.rx_response, within, most / len(self.tx), least)
        self.growth = sum_growth * self.tx.growth * self.rx.growth
        self.error = sum_growth * (self.tx.error + self.tx.growth * self.rx.error)
        self.tolerance = (tolerance - self.error) / self.growth
        self.runs = len(self.tx) * len(self.rx) * len(rows.track)
        self._planned: dict[tuple[int, ...], tuple[ChannelEchoes, np.ndarray]] = {}

    @property
    def interpolates(self) -> bool:
        """Whether there are fewer positions than elements, transmitting or receiving."""
        return self.tx.basis is not None or self.rx.basis is not None

    def _most(self, scatterers: int) -> float:
        """Largest number of pairs of positions at which interpolation counts as cheaper than separate channels."""
        layout, fixed = self.layout, cost_model.CHANNEL_RUN + cost_model.CHANNEL_SCATTERER * scatterers
        width = min(layout.grid.width, layout.grid.n)
        separate = cost_model.INTERPOLATION_PAYS * (fixed + cost_model.CHANNEL_SAMPLE * width)
        saved = layout.runs * (separate - cost_model.CHANNEL_INTERPOLATED * width)
        return saved / (len(layout.rows.track) * (fixed + cost_model.CHANNEL_SAMPLE * layout.grid.n))

    def is_faster(self, scatterers: int) -> bool:
        """Whether interpolation takes less time than separate channels, by the cost model."""
        return self.interpolates and len(self.tx) * len(self.rx) <= self._most(scatterers)

    def _is_smooth(self, scene: Scene, vertical: np.ndarray, tolerance: float) -> bool:
        """Whether echoes are smooth over the array: antennas far away, no scatterer at a limit of the range window.

        Paths are convex functions of the positions of scatterers and elements. They are largest at corners of their
        boxes, and inside fall below the values there by at most `bow`; paths to the reference point, which are
        subtracted, the other way round.
        """
        layout, rows, track = self.layout, self.layout.rows, self.layout.rows.track
        radius = float(np.linalg.norm(np.ptp(scene.bounds, axis=0))) / 2
        elements = [self.transmitters, self.receivers]
        extent = max(float(np.linalg.norm(np.ptp(p, axis=0))) for p in elements)
        reach = max(float(np.linalg.norm(p, axis=1).max()) for p in elements)
        near, near_point = (
            min(float(np.linalg.norm(e - point, axis=1).min()) for e in track.ends) - reach
            for point in (self.center, rows.point)
        )
        near -= radius
        if extent > FAR * near or (extent and near_point < 4 * extent):
            return False
        if len(scene.triangles) and not self._sees_same_facets(extent / near, vertical, tolerance):
            return False
        bow = 2 * (radius + extent) ** 2 / near
        over = extent**2 / near_point if extent else 0.0
        alias = 0.98 * SPEED_OF_LIGHT / (4 * layout.grid.step)
        boxes = [corners(np.stack([p.min(axis=0), p.max(axis=0)])) for p in elements]
        for start in range(0, len(track), BLOCK):
            at = slice(start, start + BLOCK)
            tx, rx = rows.tx_positions(boxes[0], at), rows.rx_positions(boxes[1], at)
            sent, back = (_paths(e, corners(scene.bounds)) for e in (tx, rx))
            stated = tx if rows.separated else track.tx[at][:, None]
            for point, from_tx, window, excess in (
                (rows.point, stated, layout.window, over),
                (self.center, tx, (-alias, alias), extent**2 / near),
            ):
                low, high = 0.0, 0.0
                for paths, ends in ((sent, from_tx), (back, rx)):
                    off = paths - _paths(ends, point[None])
                    low, high = low + off.min(axis=1) / 2, high + off.max(axis=1) / 2
                if np.min(low) - bow < window[0] or np.max(high) + excess > window[1]:
                    return False
        return True

    def _sees_same_facets(self, angle: float, vertical: np.ndarray, tolerance: float) -> bool:
        """Whether facets that face one element face all, with equal H and V; angle, rad, that the array subtends."""
        track = self.layout.rows.track
        look = track.tx - self.center
        off_vertical = np.linalg.norm(np.cross(unit(look), vertical), axis=1)
        turned = angle / max(float(off_vertical.min()), 1e-12)
        return track.is_monostatic and max(angle**1.5, turned**2) <= GRAZING * tolerance

    @property
    def bands(self) -> list[Band]:
        """Band of all computed echoes: the whole band."""
        return [self.layout.band(self.layout.frequencies)]

    def least(self, scene: SceneEchoes) -> float:
        """Pulses of a block, at least; by levels all blocks repeat the work on small cells."""
        by_levels = any(channel.apart()[1] for _, channel, _ in self._pairs(scene))
        return np.inf if by_levels else most_pulses(scene.request.device)

    def fresh(self) -> InterpolatedChannels:
        """The same for another device: nothing is planned yet."""
        other = copy.copy(self)
        other._planned = {}
        return other

    def pulses(self, budget: float) -> int:
        """Pulses per call of `fill`: echoes at the positions and those of one channel take half the budget, bytes."""
        rows, grid = self.layout.rows, self.layout.grid
        names = len(rows.polarizations)
        at_positions = 8 * len(self.tx) * len(self.rx) * names * grid.n
        channel = rows.n_receivers * (min(grid.width, grid.n) * (48 + 24 * names) + 100)
        return max(1, int(budget / 2 / (at_positions + channel)))

    def fill(self, scene: SceneEchoes, samples: np.ndarray, start: int, done: int, total: int) -> Added:
        """Add echoes to samples, as `SeparateChannels.fill` does."""
        layout, rows, added = self.layout, self.layout.rows, Added()
        frequencies = layout.frequencies
        echoes = np.empty((len(self.tx), len(self.rx), len(samples), samples.shape[3], layout.grid.n), np.complex64)
        pulses = range(start, start + len(samples))
        for (i, j), at_pair, rounded in self._pairs(scene):
            before = done + added.counts.pairs
            echoes[i, j], at_position = echoes_of(at_pair, pulses, len(frequencies), before, total)
            added += at_position
            if np.abs(rounded).max() * frequencies[-1] > 1e-9 * SPEED_OF_LIGHT:  # thousands of kilometres away
                echoes[i, j] *= _phase(-rounded[pulses.start : pulses.stop], frequencies)[:, None]
        shared = (
            None
            if self.own
            else self._rx_lengths(rows.rx_positions(rows.receivers, slice(start, start + len(samples))))
        )
        for channel, at, block in active_channels(layout.sent, start, len(samples)):
            if shared is None:
                lengths = self._rx_lengths(rows.rx_positions(channel.offset[None], at))
            else:
                lengths = shared[0][block], shared[1][block]
            self._add(scene, channel, at, echoes[:, :, block], samples[block], *lengths)
        scene.request.clock.lap("channels")
        return replace(added, error_terms=self.between(added.error_terms))

    def planned(self, scene: SceneEchoes) -> Added:
        """The plan of the echoes of all pulses, without these."""
        added = Added()
        for _, channel, _ in self._pairs(scene):
            added += Added(channel.error_terms, channel.plan)
        return replace(added, error_terms=self.between(added.error_terms))

    def _pairs(self, scene: SceneEchoes) -> Iterator[tuple[tuple[int, int], ChannelEchoes, np.ndarray]]:
        """Pairs of positions: numbers, plan of the echoes of all pulses, rounding of the paths, m (n_pulses,)."""
        for pair in np.ndindex(len(self.tx), len(self.rx)):
            if pair not in self._planned:
                geometry, band, rounded = self._geometry(*pair)
                self._planned[pair] = scene.channel(geometry, band, self.layout.frequencies), rounded
            channel, rounded = self._planned[pair]
            yield (pair[0], pair[1]), channel.of(scene), rounded

    def _geometry(self, i: int, j: int) -> tuple[PulseGeometry, Waveform, np.ndarray]:
        """Geometry of all pulses at a pair of positions, band, and rounding of the paths, m (n_pulses,)."""
        layout, rows = self.layout, self.layout.rows
        grid, frequencies = layout.grid, layout.frequencies
        band = band_of(layout.waveform, float(frequencies.mean()), grid.n * grid.step)
        reach = SPEED_OF_LIGHT / (4 * grid.step)
        tx = rows.tx_positions(self.tx.at[i])
        rx = rows.rx_positions(self.tx.at[i] if self.own else self.rx.at[j])
        path = _length(tx, self.center) + _length(rx, self.center)
        reference = np.asarray(path / 2, np.float64)
        geometry = layout.geometry(tx, rx, reference, frequencies, (-reach, reach))
        return geometry, band, np.asarray(path - 2 * reference, np.float64)

    def between(self, terms: tuple[ErrorTerm, ...]) -> tuple[ErrorTerm, ...]:
        """Error terms of channels interpolated between positions where echoes have these."""
        grown = tuple(replace(term, value=self.growth * term.value) for term in terms)
        at_positions = root_sum_square(grown)
        both = self.error + at_positions  # these two add up themselves, not their squares
        remaining = float(np.sqrt(both**2 - at_positions**2))
        return *grown, ErrorTerm("interpolation between channels", remaining, SMALLER_TOLERANCE)

    def _rx_lengths(self, rx: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lengths, m, from rx (n, m, 3) to the scene's centre, in extended precision, and to the reference point."""
        return _length(rx, self.center), np.linalg.norm(rx - self.layout.rows.point, axis=-1)

    def _add(
        self, scene: SceneEchoes, channel: Channel, at: slice, echoes: np.ndarray, samples: np.ndarray,
        to_center: np.ndarray, to_reference: np.ndarray,
    ) -> None:  # fmt: skip
        """Interpolate a channel from echoes at the positions, and add it, at every receiver, to samples of pulses `at`.

        to_center, to_reference  lengths from the receivers, as `_rx_lengths` returns them
        """
        layout, rows = self.layout, self.layout.rows
        part, frequencies = layout.samples(channel)
        number = int(np.flatnonzero((self.transmitters == channel.offset).all(axis=1))[0])
        part_of_band = echoes[..., layout.grid.part(channel.carrier)]
        if self.tx.basis is None:
            at_tx = part_of_band[number]
        else:
            at_tx = np.einsum("k,k...->...", self.tx.basis[number].astype(np.float32), part_of_band)
        # no BLAS: its sums depend on how many pulses there are
        at_rx = at_tx if self.rx.basis is None else np.einsum("jk,k...->j...", self.rx.basis.astype(np.float32), at_tx)
        values = np.moveaxis(at_rx, 0, 1)
        tx = rows.tx_positions(channel.offset, at)
        tx_to_reference = np.linalg.norm((tx if rows.separated else rows.track.tx[at]) - rows.point, axis=-1)
        reference = (tx_to_reference[:, None] + to_reference) / 2  # as `ChannelRows.fields` rounds it
        path = np.asarray(_length(tx, self.center)[:, None] + to_center - 2 * reference, np.float64)
        spectrum = layout.spectrum(channel, frequencies) * scene.weights.factor(frequencies)
        values = values * (_phase(path, frequencies) * spectrum).astype(np.complex64)[:, :, None]
        rows.add(samples, channel, slice(None), part, values)

    def describe(self) -> dict[str, int]:
        """Words and numbers for a report."""
        return {"array positions": len(self.tx) * len(self.rx)}


def _paths(antennas: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Lengths from antennas (n, m, 3) to points (k, 3), m (n, m, k)."""
    return np.asarray(np.linalg.norm(antennas[..., None, :] - points, axis=-1))


def _length(antennas: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Lengths from antennas (..., 3) to one point (3,), m (...), in extended precision."""
    d = antennas.astype(np.longdouble) - point
    return np.asarray(np.sqrt((d * d).sum(axis=-1)))


def _phase(path: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    """exp(-j 2 pi f path/c) of paths, m (...), at frequencies, Hz (n,): (..., n)."""
    cycles = path[..., None] * (frequencies / SPEED_OF_LIGHT)
    return np.asarray(np.exp(-2j * np.pi * (cycles - np.rint(cycles))))
