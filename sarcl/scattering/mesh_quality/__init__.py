"""Warnings about meshes: too coarse for the wavelength, or for speckle.

For other folders:

    facet_error        error of flat facets against the curved surface they approximate, dB
    facet_groups       neighbours in one plane, which are one facet to a wave
    post_spacing       posts with random heights that an image resolves
    speckle_contrast   speckle contrast that the number of facets per resolution cell allows

For this folder alone:

    _adjacency         which facets share edges
    _curvature         height of the curved surface over its flat facets
    _curved_echo       echo of the curved surface
"""
