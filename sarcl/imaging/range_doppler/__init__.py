"""Range-Doppler: images of near-straight tracks by FFTs along the track and in range.

For other folders:

    range_doppler     range_doppler(): the image, its plan, and its error against backprojection

For this folder alone:

    _aperture_window  a window over the beam, as weights of Doppler bins
    _bins             Doppler bins: secondary range compression, migration, azimuth compression
    _doppler          Doppler band that an image needs, Doppler centroid
    _extent           rows and columns of the image, the range window and the pulse rate they need
    _focus            the work: azimuth FFT, secondary range compression, migration, azimuth compression
    _focus_on_device  the same on a GPU, from samples that go up once to the image that comes down once
    _ground           positions at zero-Doppler times and slant ranges, at a height or on an elevation model
    _host_rows        rows with weights and one reference range, made on the host
    _map_drift        Doppler rate from the displacement of two looks
    _options          options of range_doppler
    _plan             rows, columns, Doppler bins, range blocks and the predicted error
    _range_window     slant ranges that lie in the range window of every row
    _task             arguments checked; track, ground, extent and plan of one image
    _track            an evenly sampled smooth track
    _uneven_energy    errors where energy lies unevenly over rows and ranges: ends of the Doppler band, dark columns
    _velocity         ranges from a track to points as hyperbolas: effective velocity at several slant ranges
"""
