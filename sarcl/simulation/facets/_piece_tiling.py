"""Pieces of rough facets put into tiles on the device that cuts them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base import float_pairs
from ...opencl.device import Buffer
from ...opencl.launch_numbers import launch_numbers
from ...scattering.rough_pieces import KERNELS, RoughPieces, in_groups
from ..spreading import PER_TILE, DeviceTiles

BUFFERS = "references", "radius", "offsets", "planes"  # of DeviceTiles


class PieceTiles(DeviceTiles):
    """Tiles of pieces, which are made on the device when their buffers are first used."""

    def __init__(self, tiling: PieceTiling, per_tile: int) -> None:
        """tiling  of the pieces;  per_tile  pieces in a tile"""
        n_tiles = tiling.n_tiles(per_tile)
        vars(self).update(tiling=tiling, per_tile=per_tile, n_tiles=n_tiles, order=tiling.order)
        vars(self).update(n_offsets=len(tiling.order), last=len(tiling) - per_tile * (n_tiles - 1))

    def __getattr__(self, name: str) -> object:
        if name not in BUFFERS:
            raise AttributeError(f"{type(self).__name__} has no {name}")
        tiling: PieceTiling = vars(self)["tiling"]
        vars(self).update(zip(BUFFERS, tiling.buffers(self.per_tile), strict=True))
        return vars(self)[name]

    def release(self) -> None:
        """As of DeviceTiles: the pieces leave the device where they do not stay."""
        for name in () if vars(self)["tiling"].stays else BUFFERS:
            vars(self).pop(name, None)


class PieceTiling:
    """Tiles of pieces in the order in which a device cuts them: neighbours along the Morton curve of their facets."""

    def __init__(self, pieces: RoughPieces, surfaces: np.ndarray, kinds: np.ndarray, *, stays: bool = True) -> None:
        """surfaces, kinds  as `RoughPieces.placed` takes them
        stays  False: pieces are made anew for each block of pulses, and leave the device after it
        """
        self.pieces, self.device, self._numbers, self.stays = pieces, pieces.device, (surfaces, kinds), stays
        self.bounds = pieces.bounds
        self.center = self.bounds.mean(axis=0)
        largest = max(PER_TILE)
        self.stride = -(-len(pieces) // largest) * largest
        self.order = np.minimum(np.arange(self.stride), len(pieces) - 1)
        placed = self._place()
        self.radii = {n: self._bounds(n, placed[0])[0][3] for n in PER_TILE}
        self._placed: tuple[Any, Any] | None = placed if stays else None
        self._tiles: PieceTiles | None = None

    def __len__(self) -> int:
        return len(self.pieces)

    def n_tiles(self, per_tile: int) -> int:
        """Number of tiles of `per_tile` pieces."""
        return -(-len(self) // per_tile)

    def tiles(self, per_tile: int) -> DeviceTiles:
        """Tiles of `per_tile` pieces on the device."""
        if self._tiles is None or self._tiles.per_tile != per_tile:
            self._tiles = PieceTiles(self, per_tile)  # frees the buffers of the other size
        return self._tiles

    def buffers(self, per_tile: int) -> tuple[Any, ...]:
        """What DeviceTiles have on the device: references, radius, offsets, planes."""
        centers, planes = self._placed or self._place()
        self._placed = None  # the centres are not needed beside their offsets
        tiles, on_device = self._bounds(per_tile, centers)
        offsets, device = self.device.empty(24 * self.stride), self.device
        device.run(
            device.kernel(KERNELS, "tile_offsets"), (self.stride // device.info.vector_width,), None,
            self._tile_numbers(per_tile, tiles.shape[1]), centers, on_device, offsets,
        )  # fmt: skip
        references, radius = float_pairs.wide(tiles[:3]), tiles[3].astype(np.float32)
        return device.upload(references), device.upload(radius), offsets, planes

    def on_host(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions of the pieces, m (n, 3), and their numbers as the kernels read them, float32 (k, n)."""
        centers, planes = self._placed or self._place()
        n, size = len(self), self.stride
        places = self.device.download(centers, np.empty((3, size)))[:, :n].T
        rows = planes.size // (4 * size)
        return np.ascontiguousarray(places), self.device.download(planes, np.empty((rows, size), np.float32))[:, :n]

    def _place(self) -> tuple[Any, Any]:
        return self.pieces.placed(*self._numbers, self.stride)

    def _bounds(self, per_tile: int, centers: Buffer) -> tuple[np.ndarray, Buffer]:
        """Middles of tiles about the centre, and their radii, m (4, n_tiles), and the same on the device."""
        n_tiles = self.n_tiles(per_tile)
        tiles = self.device.empty(32 * n_tiles)
        self.device.run(
            self.device.kernel(KERNELS, "tile_bounds"),
            in_groups(n_tiles),
            None,
            self._tile_numbers(per_tile, n_tiles),
            centers,
            tiles,
        )
        return self.device.download(tiles, np.empty((4, n_tiles))), tiles

    def _tile_numbers(self, per_tile: int, n_tiles: int) -> np.ndarray:
        x, y, z = self.center.view(np.uint64)
        return launch_numbers(
            KERNELS, "tile_bounds", stride=self.stride, per_tile=per_tile, n_tiles=n_tiles, x=x, y=y, z=z
        )
