"""Full-wave scattering on a Yee grid (FDTD), and fullwave_echo().

docs/theory/full_wave.md has the equations; docs/developers/full_wave.md has the arrays, and what files hand on.

For other folders:

    absorber      absorbing layers (CPML)
    anchors       echoes along a track from anchors that are chosen, predicted, run and interpolated
    bodies/       targets of closed meshes: conductors that cut cells, dielectrics
    current_sums  sums of currents over cells for many pulses, on a device
    currents      one run: the equivalent currents of a target at the frequencies that are asked for
    dispersion    plane waves of the grid: wavenumber, frequency, polarisation, energy flux
    echoes/       fullwave_echo(): echoes of a track from few runs of the grid
    fields        fields on a device and their time steps, tile by tile
    formed_echoes  waveform forming: echoes of many pulses from the currents of one run
    incident      a plane wave that enters through the faces of a box
    lattice       the grid: cells, positions of field components, places in buffers
    mirrors       targets that a mirror leaves unchanged, and the anchors that then share a run
    pulse         the waveform of the incident wave, by its spectrum
    runs          one run as echoes need it: grid, cost, echoes that the currents form
    target        what a target is to the grid: lists of edges and faces

For this folder alone:

    _along_track  sums over cells at some pulses of a smooth track, interpolated at the others
    _anchor_model interpolation between anchors by their correlation, and its error
    _lists        lists of cells on a device
"""
