"""What a facet sends back, and how finely it must be computed.

For other folders:

    added_models           scattering models of installed packages, in float64 on the host
    antenna_weight_error   errors of antenna_weights over facets, over the band and in float32
    antenna_weights        antenna gains, spreading loss and the radar's factor per scatterer
    double_diffraction     waves from one border of a flat face to another
    edge_diffraction       fringe currents of wedges: the physical theory of diffraction
    facet_kinds            which facets are mirrors, which are random, and which are alike
    facet_plan             subdivision and frequency nodes of facets for a tolerance
    facet_shadows          what casts shadows in a scene, and what antennas see of pieces of facets
    facets                 facets ready for the kernel: subdivided, displaced, culled, illuminated
    facing_corners         what single reflections leave out where flat parts face each other at right angles
    half_plane             waves beside the edge of a half-plane that reflects them
    kept_amplitudes        error of amplitudes that are interpolated between antenna positions, with phases
    physical_optics        phase integral, Fresnel coefficients and scattering matrix of a planar facet
    pulse_nodes            pulses at which amplitudes are computed, with cubic interpolation between them
    random_surface         cells of rough facets, with a random height and amplitude each
    rough_pieces           rough facets cut on a device, where the kernels read the pieces
    scatterers             from a scene to the points and facets that the kernels add
    subdivision            facets cut to the edge length of their plan
    thin_sheets            what is seen through thin sheets, and how much they let through
    mesh_quality/          warnings about meshes that are too coarse for their curves or for speckle

For this folder alone:

    _cutting_error         errors of cut facets, which cancel between pieces
    _direction_error       errors of directions: cosines in float32, H and V that turn near the vertical
    _facet_norm            norms of facets at random phases, coplanar neighbours as one: the gain of cutting
    _facet_sampling        random samples of the facets or points of a scene
    _frequency_nodes       frequencies at which amplitudes are computed
"""
