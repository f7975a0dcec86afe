"""spectral_echo(): echoes of straight tracks by Fourier transforms of the reflectivity map.

For other folders:

    planning_time           how long a plan may take
    spectral_echo           spectral_echo(): the samples of echo, to a stated tolerance
    spectral_parts          the plan of a scene: parts that are transformed, facets that are added pulse by pulse
    spectral_task           one task of spectral_echo: its arguments, checked; what is refused

For this folder alone:

    _aspect_expansion       amplitudes over aspect and frequency as sums of few products
    _aspect_window          a window over the aspects that a track sees, and the wavenumbers along it
    _aspects_seen           limits of these aspects: the track's ends, beams, the pulse repetition frequency
    _azimuth_transfer       responses along the track, transformed numerically
    _beam_edges             hard edges of beams: the aspects at which each scatterer passes them
    _beam_extent            aspects between which a beam receives all but a share of the energy
    _edge_map               what hard edges add: maps whose azimuths are numbers of pulses
    _facet_factors          amplitudes of facets at one aspect after the other, on a device
    _map_part               one map of a part of a scene, with its transfer functions
    _map_plan               grid of the map, and the range wavenumbers at which its spectrum is read
    _map_spectrum           the map's spectrum at the range wavenumbers of every frequency
    _scatterer_amplitudes   amplitudes of points and facets, seen from places on the track
    _scratch                complex arrays in memory or in temporary files
    _spectral_blocks        spectra as a job that is computed in blocks
    _spectral_options       options of spectral_echo
    _spectral_part          points or facets: plan, and spectra along the track
    _spectral_plan          the plan of spectral echoes, and its run
    _spectral_samples       from spectra along the track to samples
    _stationary_phase       the transfer function of SARAS, by stationary phase
    _straight_track         straight, evenly spaced tracks; azimuth and slant range of scatterers
"""
