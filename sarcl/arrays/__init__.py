"""Fields and apertures of frequency-diverse arrays, without a scene.

For other folders:

    ambiguity      ambiguity functions of waveforms
    array_factor   closed forms of linear and planar arrays
    beam           field of an array at given positions and times
    channels       carriers, transmitting elements and frequency samples of an array's channels
    map_aperture   phase histories with the array's delays corrected, or mapped to apparent positions

For this folder alone:

    _beam_plan     number type, blocks and predicted error of beam()
"""
