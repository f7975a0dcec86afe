"""Amplitudes of facets at one aspect and frequency after the other, on a device: kernels/facet_aspects.cl."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...opencl.device import Device
from ...opencl.launch_numbers import launch_numbers
from ...scattering.facets import POLARIZATIONS, FacetSet, diagram_macros, vertical_axes
from ._scatterer_amplitudes import ScattererAmplitudes
from ._straight_track import tangent

KEPT = 4  # share of max_bytes, 1/n: blocks are kept on the device up to this, else made anew for every term


class FacetFactors:
    """Amplitudes of some facets, seen from a straight track, weights of antennas included."""

    def __init__(
        self,
        device: Device,
        amplitudes: ScattererAmplitudes,
        some: np.ndarray,
        budget: float,
        at_once: int = 2**18,
    ) -> None:
        """some  indices of the facets (n,);  budget  bytes;  at_once  facets of a block, some 40 MB on the host"""
        self.at_once = at_once
        facets, weights = amplitudes.part, amplitudes.weights
        assert isinstance(facets, FacetSet)
        self.device, self.amplitudes, self.facets, self.some = device, amplitudes, facets, some
        # a single antenna receives as V what is sent as H, exactly as it receives as H what is sent as V
        wanted = ["HV" if name == "VH" else name for name in amplitudes.polarizations]
        made = [name for name in POLARIZATIONS if name in wanted]
        self.n_made, self.channels = len(made), [made.index(name) for name in wanted]
        self.kernel = device.kernel(
            "facet_aspects.cl", "aspect_amplitudes", BISTATIC=0, RANGE=0, ORDER=2, ROUGH=int(facets.is_rough),
            **{name: int(name in made) for name in POLARIZATIONS},
            **weights.macros(1), **(diagram_macros() if facets.is_rough else {}),
        )  # fmt: skip
        self.patterns, self.second = weights.upload(device)
        self.axes = device.upload(weights.packed_axes(np.zeros(1, np.int64)))
        self.up = device.upload(vertical_axes(amplitudes.vertical))
        per_facet = 4 * (11 + 6 * facets.is_rough)
        self.kept: list[tuple[slice, Any, Any]] | None = None
        if per_facet * len(some) <= budget / KEPT:
            self.kept = list(self._made())

    def _made(self) -> Iterator[tuple[slice, Any, Any]]:
        """Blocks of the facets, with the kernel's planes of each."""
        track = self.amplitudes.track
        for start in range(0, len(self.some), self.at_once):
            block = slice(start, min(start + self.at_once, len(self.some)))
            here = self.some[block]
            order = np.minimum(np.arange(self._padded(len(here))), len(here) - 1)
            planes = self.facets.picked(here).planes(order, np.zeros(0), True, False)
            across = np.ones((4, len(order)), np.float32)
            across[:3] = track.across(self.amplitudes.positions[here])[order].T
            across[3] = self.amplitudes.slant_range[here][order]
            yield block, self.device.upload(planes), self.device.upload(across)

    def _padded(self, n: int) -> int:
        lanes = self.device.info.vector_width
        return -(-n // lanes) * lanes

    def __call__(self, sine: float, frequency: float) -> np.ndarray:
        """Amplitudes at one sine of the aspect and one frequency, Hz: complex64 (n, n_polarizations)."""
        out = np.empty((len(self.some), len(self.channels)), np.complex64)
        wave, weights, track = frequency / SPEED_OF_LIGHT, self.amplitudes.weights, self.amplitudes.track
        numbers = (*track.along, sine, np.sqrt(1 - sine**2), wave, np.sqrt(np.pi) * wave)
        aspect = self.device.upload(np.array([*numbers, frequency / weights.frequency, weights.range], np.float32))
        roots = self.facets.roots(frequency)
        for block, planes, across in self.kept if self.kept is not None else self._made():
            here = self.some[block]
            n = self._padded(len(here))
            root = np.zeros((2, n), np.float32)
            of_facets = roots[self.facets.material[here]]
            root[0, : len(here)], root[1, : len(here)] = of_facets.real, of_facets.imag
            made = self.device.empty(8 * self.n_made * n)
            self.device.run(
                self.kernel, (n // self.device.info.vector_width,), None,
                launch_numbers("facet_aspects.cl", "aspect_amplitudes", n=n, second=self.second),
                planes, across, self.device.upload(root), aspect, self.up, self.patterns, self.axes, made,
            )  # fmt: skip
            parts = self.device.download(made, np.empty((self.n_made, 2, n), np.float32))[..., : len(here)]
            for i, channel in enumerate(self.channels):
                out[block, i].real, out[block, i].imag = parts[channel]
            if self.amplitudes.shares is not None:
                place = self.amplitudes.azimuth[here] + self.amplitudes.slant_range[here] * float(tangent(sine))
                out[block] *= self.amplitudes.shares.at(here, place / track.spacing)[:, None].astype(np.float32)
        return out
