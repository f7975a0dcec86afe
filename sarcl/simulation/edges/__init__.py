"""Echoes of the edges of conductors.

For other folders:

    edge_echoes   edges of a channel, added up in float64 on the host

For this folder alone:

    _edge_pieces  edges cut into pieces, the part of each that antennas see, and its amplitude
"""
