"""Surfaces of COLLADA files (.dae) that trimesh would leave out or cover wrongly in silence: refused."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from . import _checks

if TYPE_CHECKING:
    import collada

AGAIN = "export it again"


@contextmanager
def without_deprecations() -> Iterator[None]:
    """No warnings about pycollada's own use of NumPy: they say nothing of the file, and as errors would refuse it."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=DeprecationWarning, module="collada")
        yield


def open_document(data: bytes) -> collada.Collada:
    """The file as pycollada reads it, with the list of what it could not read; its exceptions for what is no file."""
    import collada

    return collada.Collada(io.BytesIO(data), ignore=[collada.common.DaeError])


def check(document: collada.Collada, what: str) -> None:
    """ValueError for surfaces that are missing or covered wrongly; document  of `open_document`."""
    tag, root = document.tag, document.xmlnode.getroot()
    if next(root.iter(tag("instance_controller")), None) is not None:
        raise ValueError(
            f"{what} has skins or morphed shapes (controllers), which are not read; apply them, then {AGAIN}"
        )
    if next(root.iter(tag("ph")), None) is not None:
        raise ValueError(f"{what} has polygons with holes, which are not read here; export it as triangles")
    n_declared = sum(1 for one in root.iter(tag("geometry")) if one.find(tag("mesh")) is not None)
    n_missing = n_declared - len(document.geometries)
    if n_missing > 0:
        raise ValueError(f"{what}: {n_missing} of {n_declared} geometries cannot be read ({_why(document)}); {AGAIN}")
    libraries = [*root.iter(tag("library_visual_scenes")), *root.iter(tag("library_nodes"))]
    n_declared = sum(1 for one in libraries for kind in ("geometry", "node") for _ in one.iter(tag(f"instance_{kind}")))
    placed = [node for one in (*document.scenes, document) for top in one.nodes for node in _instances(top)]
    n_missing = n_declared - len(placed)
    if n_missing > 0:
        raise ValueError(
            f"{what}: {n_missing} of {n_declared} placed geometries cannot be read ({_why(document)}); {AGAIN}"
        )
    for geometry in {id(node.geometry): node.geometry for node in placed if hasattr(node, "geometry")}.values():
        for primitive in geometry.primitives:
            _check_primitive(primitive, f"{what}, geometry {geometry.id!r:.60}")


def _instances(node: collada.scene.SceneNode) -> Iterator[collada.scene.SceneNode]:
    """Geometries, and other nodes, that a node and its children place; what those nodes hold is listed there."""
    if hasattr(node, "geometry") or hasattr(node, "node"):
        yield node
        return
    for child in getattr(node, "children", ()):
        yield from _instances(child)


def _why(document: collada.Collada) -> str:
    return f"{document.errors[0]!s:.120}" if document.errors else "a reference to what is not there"


def _check_primitive(primitive: collada.primitive.Primitive, where: str) -> None:
    if getattr(primitive, "vertex_index", None) is None:
        return
    index = np.asarray(primitive.vertex_index, np.int64)
    if (index < 0).any():
        raise ValueError(f"{where}: a face names vertex {index.min()} of {len(primitive.vertex)}; {AGAIN}")
    if not hasattr(primitive, "vcounts"):
        return
    corners = np.asarray(primitive.vcounts, np.int64)
    if (corners < 3).any():
        face = int(np.argmax(corners < 3))
        raise ValueError(f"{where}: face {face} has {corners[face]} corners, wanted at least 3; {AGAIN}")
    if corners.sum() != len(index):
        raise ValueError(f"{where}: its faces have {corners.sum()} corners, and it holds {len(index)}; {AGAIN}")
    wrong = _checks.wrong_fans(corners, index, np.asarray(primitive.vertex))
    if wrong:
        raise ValueError(f"{where}: face {wrong[0]}, of {corners[wrong[0]]} corners, {_checks.CONCAVE}")
