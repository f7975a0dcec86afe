"""Targets of closed meshes on the grid: conductors that cut cells, dielectrics, conductors in dielectrics.

For other folders:

    cut_cells     conductors that cut cells, from the intervals of grid lines inside them and the areas of faces
    materials     bodies of several materials as lists of edges and faces
    mesh_lines    where grid lines are inside bodies of closed meshes

For this folder alone:

    _averages     means of the permittivity about points of the grid, and normals of surfaces
    _closed_mesh  closed meshes in whole numbers; refusals of open meshes
    _dielectrics  permittivities of the edges of the grid in dielectric and lossy bodies
    _face_areas   how much of each face of the grid closed meshes cover
    _thin_parts   parts of a mesh that are thinner than a cell: refusals, and sheets in place of narrow strips
"""
