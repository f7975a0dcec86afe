"""Mesh files through trimesh, with checks of what it reads wrongly or leaves out in silence.

For other folders:

    mesh              meshes: triangles, names of parts, repaired, with their unit

For this folder alone:

    _archive          meshes in archives
    _checks           faces that a mesh file declares and holds; polygons and the fans that cover them
    _collada_checks   surfaces of COLLADA files that would be left out or covered wrongly in silence: refused
    _gltf_checks      surfaces of glTF files that would be left out in silence: refused
    _ply              PLY files: vertices and polygons, each number of the type that its header declares
    _repair           repairs of meshes: winding, faces that collapse or repeat
    _text             text of .obj and .off files: as trimesh reads it right, or refused
"""
