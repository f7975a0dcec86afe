"""Surfaces of glTF 2.0 files that their reader would leave out in silence: refused (Khronos, sections 3.6, 3.7)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

MAGIC, JSON_CHUNK = b"glTF", 20  # first bytes of a .glb file; where the text of its first chunk begins
# extensions that change where surfaces are, and those that say how they look, which is not needed
PLACES = {"EXT_mesh_gpu_instancing", "KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"}
LOOKS = tuple(
    "KHR_materials_ KHR_texture_ KHR_lights_ KHR_xmp KHR_animation_pointer EXT_texture_ EXT_lights_ MSFT_texture_ "
    "ADOBE_materials_ AGI_ CESIUM_outline KHR_mesh_quantization".split()
)
FAN = 6  # mode of a primitive; trimesh reads 4 (triangles) and 5 (strips), and 0 to 3 are points and lines
INTEGERS = (5120, 5121, 5122, 5123)  # component types of quantized positions
TAKE = "which is not read here, and its surfaces would be missing or elsewhere"
AGAIN = "export it without"


def check(data: bytes, what: str) -> None:
    """ValueError for a file with surfaces that would be left out or misplaced: what it is, and how to export it.

    Files whose text cannot be read are left to the reader that says so.
    """
    text = data
    if data[:4] == MAGIC:
        text = data[JSON_CHUNK : JSON_CHUNK + int.from_bytes(data[12:16], "little")]
    try:
        header = json.loads(text)
    except (ValueError, RecursionError):
        return
    if not isinstance(header, dict):
        return
    needed = header.get("extensionsRequired")
    for name in needed if isinstance(needed, list) else []:
        if name in PLACES or not str(name).startswith(LOOKS):
            raise ValueError(f"{what} needs the extension {name!r:.60}, {TAKE}; {AGAIN} it")
    for node in _objects(header.get("nodes")):
        for name in PLACES & set(_object(node.get("extensions"))):
            raise ValueError(f"{what} has nodes with the extension {name!r}, {TAKE}; {AGAIN} it")
    accessors = list(_objects(header.get("accessors")))
    for mesh in _objects(header.get("meshes")):
        if any(_list(mesh.get("weights"))) or any(
            any(_list(node.get("weights"))) for node in _objects(header.get("nodes"))
        ):
            raise ValueError(f"{what} has morph targets with weights other than 0, {TAKE}; apply them, then export it")
        for primitive in _objects(mesh.get("primitives")):
            if primitive.get("mode") == FAN:
                raise ValueError(f"{what} has fans of triangles (mode 6), {TAKE}; export it as triangles")
            for name in PLACES & set(_object(primitive.get("extensions"))):
                raise ValueError(f"{what} has meshes with the extension {name!r}, {TAKE}; {AGAIN} it")
            for number in (primitive.get("indices"), _object(primitive.get("attributes")).get("POSITION")):
                accessor = accessors[number] if isinstance(number, int) and 0 <= number < len(accessors) else {}
                if "sparse" in accessor:
                    raise ValueError(f"{what} has sparse accessors, {TAKE}; {AGAIN} them")
                if accessor.get("normalized") and accessor.get("componentType") in INTEGERS:
                    raise ValueError(f"{what} has normalized whole numbers as positions, {TAKE}; {AGAIN} quantization")


def _list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _object(value: object) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _objects(value: object) -> Iterator[dict[str, Any]]:
    """The objects of a list, an empty one for anything else, so that numbers of others stay as they are."""
    for one in _list(value):
        yield _object(one)
