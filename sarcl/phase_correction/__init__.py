"""autofocus(): phase errors estimated from the echoes themselves.

For other folders:

    autofocus          autofocus(): phase and range error of every pulse, estimated and removed

For this folder alone:

    _aperture_view     pulses of an aperture with trial corrections, and their images on a grid
    _bright_points     bright points of an image, and the contribution of each row to them
    _constant_echo     echoes without those of constant delay
    _displacement      displacements of bright places by a correction, each by the pulses that see it
    _echo_parts        near and far places, and the phase that sharpens some contributions most
    _hold_out          cross-validation: which correction is applied, and why none is
    _narrow_aperture   apertures over which phases near a place are linear: an FFT over the pulses focuses
    _phase_gradient    phase of each pulse from its contributions
    _phase_smoothing   phase over the aperture: smoothed, unwrapped
    _search            search for the phases and ranges that maximise the sharpness of bright points
    _smooth_search     the same for phases of few cosines
"""
