"""echo() and spectral_echo(): from a scene to a phase history.

For other folders:

    echo               echo(): echoes of points and facets, to a stated tolerance
    echo_check         random samples recomputed exactly
    echo_forecast      plan_echo(): rows, bytes, seconds and error before the work
    echo_output        destination of samples: memory or a file
    echo_sampling      rows and frequencies that echoes are written to
    scene_echoes       a scene prepared for the kernels, and its echoes added channel by channel
    spreading          plan, tiles and sums that points and facets share
    channels/          echoes of the channels of an array
    spectral/          spectral_echo(): echoes of straight tracks by Fourier transforms

For this folder alone:

    _exact_facets      few facets in few pulses and samples, added up in float64 on the host
    _facet_spreading   facets to range profiles
    _kernel_images     error of scatterers that lie so evenly that the images of the kernel add up
    _piece_tiling      pieces of rough facets in tiles on the device that cuts them
    _point_spreading   points to range profiles: a nonuniform FFT of type 1
    _pulse_levels      what consecutive pulses see of facets, as the kernel reads it
    _unseen_scene      refusal of scenes outside every beam or range window, before anything is planned
"""

__all__ = [
    "channels",
    "echo",
    "echo_check",
    "echo_forecast",
    "echo_output",
    "echo_sampling",
    "scene_echoes",
    "spectral",
    "spreading",
]
