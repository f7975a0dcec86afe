"""Reflecting objects: points, facets, materials.

For other folders:

    facing_borders  borders of flat faces that face each other
    material    Material: permittivity, conductivity, roughness below the size of a facet; the table of names
    material_arguments  arguments that name materials, as a table and an index for each facet
    scene       Scene: point scatterers and triangular facets
    shapes      solids of exact dimensions as facets: sphere, box, cone, tank ...
    terrain     facets over grids of heights, and heights above them
    triangles   areas, normals and centroids of triangles; cutting; rotations
    wedges      edges between facets, and borders of sheets

For this folder alone:

    _changes   scenes that follow from a scene: moved, placed, realized, cut; methods of Scene
    _fields    fields of a scene as read-only arrays, checked
    _kept      results that follow from a scene alone, for later calls
    _solids    triangles of surfaces of revolution, prisms and geodesic spheres
    _tank      the parts of a tank
    _target_rcs  radar cross sections of calibration targets in closed form
"""
