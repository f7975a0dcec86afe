"""Echoes of beams that facets reflect to one another: bounces=2 and more.

For other folders:

    bounce_spreader  adds these echoes to samples, to a tolerance

For this folder alone:

    _amplitudes      fields that several facets reflect one after the other, and the echo of the last one
    _beams           beams followed from facet to facet as convex polygons
    _facet_tree      facets that lie in cones and cylinders
    _flat_facets     pairs of triangles joined to larger facets, and closed bodies
    _occlusion       what lies in the way of beams
    _paths           beams of all orders, as many at a time as memory holds
    _polygons        convex polygons in space, clipped many at a time
    _sums            sums over triangles at all frequencies of the samples
    _transitions     waves beside free edges of the facets that reflected them before
    _weak_beams      bounds on the echoes of beams, and which are too weak to be followed
"""

__all__ = ["bounce_spreader"]
