"""Echoes of facets: at each pulse by themselves, factorised, or both.

For other folders:

    exact_facets          few facets in few pulses and samples, added up in float64 on the host
    facet_method          the method for a channel: factorised, directly, or both
    facet_spreading       facets to range profiles
    facets_behind_sheets  facets that are seen through thin sheets, added up in float64 on the host
    window_edges          the parts of coherent facets at the edges of a range window, in float64 on the host

For this folder alone:

    _piece_tiling         pieces of rough facets in tiles, on the device that cut them
"""
