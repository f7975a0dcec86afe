"""The only room that imports pyopencl and reikna.

For other folders:

    device   devices that passed a trial build, device choice, memory budget, programs, buffers
    fft      FFT of rows: reikna on GPUs, scipy.fft on CPU devices
"""

__all__ = ["device", "fft"]
