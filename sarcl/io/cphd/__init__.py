"""CPHD, compensated phase history data (NGA.STND.0068), 1.0.1 and 1.1.0; CRSD, radar signals (NGA.STND.0080), 1.0.

docs/theory/cphd.md has the physics.

For other folders:

    crsd_writing   a collection and the chirps that were sent as a CRSD file
    names          names of the collection in the XML of a file
    writing        a collection as a file

For this folder alone:

    _channels      the channels of a file, their polarisations, which of them are chosen
    _crsd_product  the XML of a CRSD file that is written
    _crsd_reading  a CRSD file as the fields of a phase history, compressed when rows are read (sarcl/io/formats.py)
    _domains       samples by time of arrival as samples by frequency, and back
    _product       the XML of a file that is written
    _pulses        compressed spectra as records of a received chirp, and back
    _reading       a file as the fields of a phase history; samples stay in the file (sarcl/io/formats.py imports it)
    _signal_rows   rows of the signal arrays: read when they are asked for, in the conventions of a phase history
"""
