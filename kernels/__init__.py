"""OpenCL sources of sarcl, one file an operation; shared helpers end in ``.clh``."""
