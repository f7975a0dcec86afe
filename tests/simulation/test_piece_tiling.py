"""Pieces of rough facets in tiles, on the device that cut them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import sarcl
from sarcl.numerics.tiles import tile_points
from sarcl.scattering.rough_pieces import RoughFacets, RoughPieces
from sarcl.scene import triangles as geometry
from sarcl.simulation.echo_request import EchoLimits
from sarcl.simulation.facets.facet_spreading import TiledFacets


def tiled(device, pieces, **options):
    """Tiling of pieces, at one frequency and pulse."""
    request = SimpleNamespace(device=device, limits=EchoLimits(), polarizations=("HH",))
    plan = SimpleNamespace(nodes=np.array([9.6e9]))
    return TiledFacets(request, RoughFacets(pieces), plan, range(1), None, None, **options).tiling


@pytest.mark.parametrize("per_tile", [64, 256])
def test_tiles_hold_their_pieces(double, per_tile):
    axis, cos = np.linspace(-9, 9, 6), sarcl.Material(diagram="cos")
    x, y = np.meshgrid(axis, axis)
    one = sarcl.Scene.from_heights(axis, axis, np.sin(x / 3) * np.cos(y / 4), material=cos)
    one = one + sarcl.Scene.facets(0.1 * np.eye(3)[None], material=cos)  # not cut
    one = one.moved((300.0, -2e3, 7.0))
    pieces = RoughPieces.cut(double, one, 0.4, 0, RoughPieces.suited(double, one))
    tiling = tiled(double, pieces)
    tiles = tiling.tiles(per_tile)
    assert tiling.tiles(per_tile) is tiles
    brief = tiled(double, pieces, stays=False)
    assert all((brief.radii[n] == tiling.radii[n]).all() for n in tiling.radii) and tiles.planes is tiles.planes
    for one, stays in ((tiles, True), (brief.tiles(per_tile), False)):
        planes = one.planes
        one.release()
        assert (one.planes is planes) == stays
    wanted, order = tile_points(
        geometry.centroids(pieces.corners()[0]), tiling.center, per_tile, np.arange(len(pieces))
    )
    assert (tiles.n_tiles, tiles.last) == (wanted.n_tiles, per_tile - (len(order) - len(pieces)))
    assert tiles.last < per_tile
    references = double.download(tiles.references, np.empty((2, 3, tiles.n_tiles), np.float32)).sum(axis=0, dtype=float)
    assert np.abs(references.T - wanted.references).max() < 1e-12
    assert tiling.radii[per_tile] == pytest.approx(wanted.radius, rel=1e-12)
    offsets = double.download(tiles.offsets, np.empty((6, tiles.n_offsets), np.float32))[:, : len(order)]
    # positions of 2 km round by 2e-13 m, float32 pairs of offsets in the last of 48 bits
    assert np.abs(offsets[:3].astype(float) + offsets[3:] - wanted.offsets[:3] - wanted.offsets[3:]).max() < 1e-12
