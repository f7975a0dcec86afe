"""autofocus(): phase errors estimated from the echoes themselves.

For other folders:

    autofocus          autofocus(): phase and range error of every pulse, estimated and removed

For this folder alone:

    _aperture_view     pulses of an aperture with trial corrections, and their images on a grid
    _bright_points     bright points of an image, and the contribution of each row to them
    _displacement      displacements of bright places by a correction, each by the pulses that see it
    _echo_parts        near and far places, and the phase that sharpens some contributions most
    _hold_out          cross-validation: which correction is applied, and why none is
    _phase_gradient    phase of each pulse from its contributions
    _phase_smoothing   phase over the aperture: smoothed, unwrapped
    _search            search for the phases and ranges that maximise the sharpness of bright points
"""
