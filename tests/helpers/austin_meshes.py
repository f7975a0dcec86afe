"""Meshes of the Austin RCS Benchmark Suite: a line of two numbers, corners in m, facets by numbers of corners."""

from __future__ import annotations

import numpy as np
import trimesh

import sarcl


def aircraft(folder):
    """PRIME with closed ducts, 15.05 x 14.80 x 3.13 m, nose at x = 0. from_mesh winds its halves alike."""
    lines = (folder / "austin_rcs" / "Closed-Duct_PRIME_model_meshAA.inp").read_text().splitlines()
    n_corners, n_facets = map(int, lines[0].split())
    corners = np.array([line.split() for line in lines[1 : 1 + n_corners]], float)
    facets = np.array([line.split() for line in lines[1 + n_corners : 1 + n_corners + n_facets]], int) - 1
    return sarcl.Scene.from_mesh(trimesh.Trimesh(corners, facets, process=False))
