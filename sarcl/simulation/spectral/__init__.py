"""spectral_echo(): echoes of straight tracks by Fourier transforms of the reflectivity map.

For other folders:

    spectral_echo           spectral_echo(): the samples of echo, to a stated tolerance
    spectral_task           one task of spectral_echo: geometry, plans, seconds

For this folder alone:

    _aspect_expansion       amplitudes over aspect and frequency as sums of few products
    _aspect_window          the aspects that a track sees, and the wavenumbers along it
    _azimuth_transfer       responses along the track, transformed numerically
    _map_plan               grid of the map, and the range wavenumbers at which its spectrum is read
    _map_spectrum           the map's spectrum at the range wavenumbers of every frequency
    _scatterer_amplitudes   amplitudes of points and facets, seen from places on the track
    _spectral_part          points or facets: plan, and spectra along the track
    _spectral_samples       from spectra along the track to samples
    _stationary_phase       the transfer function of SARAS, by stationary phase
    _straight_track         straight, evenly spaced tracks; azimuth and slant range of scatterers
"""

__all__ = ["spectral_echo", "spectral_task"]
