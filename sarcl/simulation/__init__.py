"""echo() and spectral_echo(): from a scene to a phase history.

For other folders:

    echo               echo(): echoes of points and facets, to a stated tolerance
    echo_check         random samples recomputed exactly
    echo_files         output and tile files of echoes that are computed in blocks
    echo_options       options of echo
    echo_output        destination of samples: memory or a file
    echo_request       what is asked of all channels alike: options, for one device
    echo_sampling      rows and frequencies that echoes are written to
    echo_task          one task of echo: its arguments, checked
    kernel_images      error of scatterers that lie so evenly that the images of the interpolation kernel add up
    planned_echoes     the method of echoes, the plan of the scene for it, and how much work they are
    reflection_options options of several reflections and of edges
    scene_defects      facets that lie on one another, and antennas inside bodies
    scene_echoes       a scene prepared for the kernels, and its echoes added channel by channel
    scene_options      options that echo and spectral_echo share
    scene_plan         shares of the tolerance for the parts of a scene, and how its facets are cut within them
    scene_preparation  a scene cut, culled and illuminated, and put on the device
    spreading          plan, tiles and sums that points and facets share
    track_options      options that every verb of echoes shares
    bounces/           echoes of beams that facets reflect to one another
    channels/          echoes of the channels of an array
    edges/             echoes of the edges of conductors
    facets/            echoes of facets, directly or factorised
    factorized/        scatterers spread about small cells at few antenna positions, and cells joined level by level
    points/            echoes of points, directly or factorised
    rcs/               rcs(): radar cross sections in directions
    spectral/          spectral_echo(): echoes of straight tracks by Fourier transforms
    tracks/            echoes of several tracks over one scene

For this folder alone:

    _echo_blocks       echoes as a job that is computed in blocks of pulses
    _echo_forecast     rows, bytes, seconds and errors of a plan of echoes, before the work
    _echo_plan         the plan of echoes, and its run
    _single_channel    echoes of one transmitting and one receiving antenna
    _unseen_scene      refusal of scenes outside every beam or range window, before anything is planned
"""
