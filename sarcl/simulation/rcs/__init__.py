"""rcs(): radar cross sections of scenes in directions.

For other folders:

    rcs           rcs(): complex scattering amplitudes for plane waves

For this folder alone:

    _beyond_single  what edges diffract, and what facets reflect to one another
    _rcs_options  options of rcs
    _rcs_plan     facets and points summed in float64, direction by direction
    _rcs_task     one task of rcs: its arguments, checked
"""
