"""Phase histories as CPHD and CRSD files. sarcl/io/cphd has the files themselves.

For other folders:

    collection     a phase history as the collection of a CPHD file; what is missing is refused
    signals        a phase history as the signals of a CRSD file; what is missing is refused
    words          what metadata= gives for CPHD and SICD, and where local coordinates lie on the Earth
"""
