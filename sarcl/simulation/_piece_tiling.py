"""Pieces of rough facets put into tiles on the device that cuts them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base import float_pairs
from ..opencl.launch_numbers import launch_numbers
from ..scattering.rough_pieces import KERNELS, RoughPieces, in_groups
from .spreading import PER_TILE, DeviceTiles


class PieceTiling:
    """Tiles of pieces in the order in which a device cuts them: neighbours along the Morton curve of their facets."""

    def __init__(self, pieces: RoughPieces, surfaces: np.ndarray, kinds: np.ndarray) -> None:
        """surfaces, kinds  as `RoughPieces.placed` takes them"""
        self.pieces, self.device, self._numbers = pieces, pieces.device, (surfaces, kinds)
        self.bounds = pieces.bounds
        self.center = self.bounds.mean(axis=0)
        largest = max(PER_TILE)
        self.stride = -(-len(pieces) // largest) * largest
        self.order = np.minimum(np.arange(self.stride), len(pieces) - 1)
        self._placed: tuple[Any, Any] | None = self._place()
        self.radii = {n: self._bounds(n)[0][3] for n in PER_TILE}
        self._on_device: DeviceTiles | None = None

    def __len__(self) -> int:
        return len(self.pieces)

    def tiles(self, per_tile: int) -> DeviceTiles:
        """Tiles of `per_tile` pieces on the device."""
        device_tiles = self._on_device
        if device_tiles is None or device_tiles.per_tile != per_tile:
            self._on_device = None  # frees the buffers of the other size first
            self._placed = centers, planes = self._placed or self._place()
            tiles, on_device = self._bounds(per_tile)
            self._placed = None  # the centres are not needed beside their offsets
            offsets, n_tiles = self.device.empty(24 * self.stride), tiles.shape[1]
            self.device.run(
                self.device.kernel(KERNELS, "tile_offsets"), (self.stride // self.device.info.vector_width,), None,
                self._tile_numbers(per_tile, n_tiles), centers, on_device, offsets,
            )  # fmt: skip
            upload = self.device.upload
            device_tiles = self._on_device = DeviceTiles(
                per_tile, n_tiles, self.order, upload(float_pairs.wide(tiles[:3])),
                upload(tiles[3].astype(np.float32)), offsets, planes, self.stride,
                len(self) - per_tile * (n_tiles - 1),
            )  # fmt: skip
        return device_tiles

    def on_host(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions of the pieces, m (n, 3), and their numbers as the kernels read them, float32 (k, n)."""
        centers, planes = self._placed or self._place()
        n, size = len(self), self.stride
        places = self.device.download(centers, np.empty((3, size)))[:, :n].T
        rows = planes.size // (4 * size)
        return np.ascontiguousarray(places), self.device.download(planes, np.empty((rows, size), np.float32))[:, :n]

    def _place(self) -> tuple[Any, Any]:
        return self.pieces.placed(*self._numbers, self.stride)

    def _bounds(self, per_tile: int) -> tuple[np.ndarray, Any]:
        """Middles of tiles about the centre, and their radii, m (4, n_tiles), and the same on the device."""
        assert self._placed is not None
        n_tiles = -(-len(self) // per_tile)
        tiles = self.device.empty(32 * n_tiles)
        self.device.run(
            self.device.kernel(KERNELS, "tile_bounds"),
            in_groups(n_tiles),
            None,
            self._tile_numbers(per_tile, n_tiles),
            self._placed[0],
            tiles,
        )
        return self.device.download(tiles, np.empty((4, n_tiles))), tiles

    def _tile_numbers(self, per_tile: int, n_tiles: int) -> np.ndarray:
        x, y, z = self.center.view(np.uint64)
        return launch_numbers(
            KERNELS, "tile_bounds", stride=self.stride, per_tile=per_tile, n_tiles=n_tiles, x=x, y=y, z=z
        )
