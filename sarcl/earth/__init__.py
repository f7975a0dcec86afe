"""The Earth under a radar: its rotation, orbits about it, terrain heights, and positions of what a radar sees.

For other folders:

    dates          dates in UTC to seconds since an epoch
    elevation      ElevationModel: heights above the ellipsoid by longitude and latitude
    grid_index     rows and columns of longitudes and latitudes, or map coordinates, in a grid
    kepler         Kepler orbits about the rotating Earth
    light_time     positions of antennas while a pulse is on its way to the rotating Earth and back
    layers         layover, shadow and incidence of terrain
    map_projection  MapProjection: coordinates of a map, through pyproj
    place          Place: a local frame on the Earth, east, north, up
    rotation       the Earth's rotation: sidereal time, inertial positions to Earth-fixed ones
    state_vectors  interpolation of state vectors, to an order chosen from the states
    two_line       orbits of two-line elements, by SGP4
    viewing        incidence, look and squint angles, ground range, Doppler frequencies
    zero_doppler   time and range of closest approach to positions, and positions from time and range
"""
