"""Echoes of the edges of conductors.

For other folders:

    edge_echoes   edges of a channel, and waves between borders of faces, added up in float64 on the host

For this folder alone:

    _border_light  what antennas see of borders of faces
    _border_pairs  pairs of borders of flat faces, and rays between them
    _edge_pieces  edges cut into pieces, the part of each that antennas see, and its amplitude
    _pair_echoes  amplitudes and delays of waves from border to border
    _paths        paths from antennas to points, and the weights of antennas there
"""
