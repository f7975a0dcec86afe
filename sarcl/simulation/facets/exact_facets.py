"""Echoes of facets summed in float64 on the host: few facets, seen in few pulses and samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.stage_timer import Clock
from ...base.vectors import unit
from ...numerics.error_bounds import FLOAT32
from ...numerics.pulse_geometry import PulseGeometry
from ...scattering.facet_plan import FacetPlan
from ...scattering.facets import FacetSet, Light
from ...scattering.physical_optics import lit_share, turned
from ...scattering.thin_sheets import FacetsThrough
from ...scene.triangles import centroids, normals
from ..spreading import ChannelView, Counts

AT_ONCE = 200_000  # amplitudes computed per block of frequencies


class ExactFacets:
    """Facets of one channel at one receiver, added up frequency by frequency: neither profiles nor interpolation.

    predicted_error  relative to the facets as they are cut, at random phases
    """

    def __init__(self, facets: FacetSet, facet_plan: FacetPlan, view: ChannelView) -> None:
        """facets  as the channel's pulses see them"""
        self.facets, self.facet_plan, self.view = facets, facet_plan, view
        # samples are stored in complex64: an error of the echo itself, and not of its pieces
        self.predicted_error = facet_plan.predicted_error + FLOAT32.unit / facet_plan.gain

    def describe(self) -> dict[str, Any]:
        """Words and numbers for a report."""
        return self.facet_plan.describe()

    def add(
        self, samples: np.ndarray, pulses: Sequence[int], clock: Clock, on_progress: Callable[[int], object]
    ) -> Counts:
        """Add to samples (n_pulses, n_polarizations, n_samples) of consecutive `pulses` of the antennas.

        on_progress is called with the number of pairs of facet and pulse that are done.
        """
        clock.lap("scene")
        counts, part, antennas = Counts(), self.facets, self.view.antennas
        places, given = centroids(part.triangles), normals(part.triangles)
        for row, p in enumerate(pulses):
            looks = [unit(end[p] - places) for end in (antennas.tx, antennas.rx)]
            seen_side = np.where(
                (part.two_sided & turned(given, looks[0], looks[1], part.forward))[:, None], -given, given
            )
            front = lit_share(seen_side, looks[0], looks[1], part.forward) > 0
            inside = inside_window(part, antennas, p)
            ends, waves = [end[p : p + 1] for end in antennas.ends], 2 * np.pi * self.view.frequencies / SPEED_OF_LIGHT
            values, _ = facet_samples(part, self.view, p, inside, part.light(p, ends, waves))
            samples[row] += values.astype(np.complex64)
            away = int((inside & ~front).sum())
            counts += Counts(len(part), int((~inside).sum()), away)
            on_progress(counts.pairs)
        clock.lap("echo")
        return counts


def inside_window(part: FacetSet, antennas: PulseGeometry, pulse: int) -> np.ndarray:
    """Which facets (k,) have their centroids in the range window of a pulse."""
    places = centroids(part.triangles)
    away = np.linalg.norm(places - antennas.tx[pulse], axis=1) + np.linalg.norm(places - antennas.rx[pulse], axis=1)
    delta = away / 2 - antennas.reference_range[pulse]
    return np.asarray((delta >= antennas.near[pulse]) & (delta <= antennas.far[pulse]))


def facet_samples(
    part: FacetSet | FacetsThrough, view: ChannelView, pulse: int, inside: np.ndarray, light: Light
) -> tuple[np.ndarray, np.ndarray]:
    """Samples (n_polarizations, n) of a pulse at the n frequencies of a channel, and their power at random phases.

    inside  the facets that count (k,);  light  what the pulse sees of them at the frequencies
    """
    antennas, frequencies = view.antennas, view.frequencies
    tx, rx, places = antennas.tx[pulse], antennas.rx[pulse], centroids(part.triangles)
    steps = (places.astype(np.longdouble) - end for end in (tx, rx))  # a metre is thousands of cycles of a long path
    path = sum(np.sqrt((step**2).sum(axis=1)) for step in steps)
    delay = (path - 2 * np.longdouble(antennas.reference_range[pulse])) / np.longdouble(SPEED_OF_LIGHT)
    weight = inside * part.share_at(pulse)
    values = np.zeros((len(view.polarizations), len(frequencies)), np.complex128)
    powers = np.zeros(values.shape)
    step = max(1, AT_ONCE // max(1, len(part)))
    for first in range(0, len(frequencies), step):
        block = frequencies[first : first + step]
        lit = Light(light.index, light.share, light.mean[:, :, first : first + step])
        sent = part.amplitudes(tx, rx, block, view.polarizations, view.vertical, lit)
        for j, f in enumerate(block.tolist()):
            wave = np.exp(-2j * np.pi * ((np.longdouble(f) * delay) % 1).astype(np.float64))
            a = sent[j] * (weight * view.weights.weights(places, pulse, f))[:, None]
            values[:, first + j], powers[:, first + j] = wave @ a, (np.abs(a) ** 2).sum(axis=0)
    return values, powers
