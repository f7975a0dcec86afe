"""The only room that imports pyopencl and reikna.

For other folders:

    choose_device  the device that is used: as asked for, as SARCL_DEVICE says, or the best one that works
    device         an open device: its programs, each built once, its buffers and its queue
    device_list    OpenCL devices of this machine, tried with a small kernel before they are used
    doctor         what keeps OpenCL, or a part of it, from working on this machine, and the remedies
    failures       errors of OpenCL as errors that name the device, the need and the remedy
    fft            FFT of rows: reikna on GPUs, scipy.fft on CPU devices
    fft_batches    rows that a device transforms some at a time, all in one buffer
    native_functions  the error of a device's own sine and cosine
    group_sizes    work-items of a kernel's groups, as many as the driver allows for this kernel
    launch_numbers  numbers of a kernel's launch as one struct by value, given by name
    memory_budget  bytes that a computation may take on a device
    pipeline       blocks of work on a device: the upload of one while the device works on the one before
    programs       source texts of kernels, and precautions for building programs

For this folder alone:

    _after_fork    refusal of OpenCL in a process that was forked after its parent had used it
    _cache_folder  a cache folder that can be written, which drivers need
    _child         Python code in a child process, which a driver that crashes or hangs ends alone
    _drivers       drivers as .icd files name them, and why the library of one cannot be loaded
    _host_arrays   buffers of CPU devices in the memory of host arrays, which stays until the kernels have ended
    _linker        the linker of PoCL, tried in another process where it is missing
    _launches      launches of kernels on GPUs, cut into parts of about 0.2 s
    _probe         OpenCL as a child process sees it, for the doctor
    _queries       questions to a driver, each guarded
    _trial         kernels whose results are known, which a device must pass
    _trial_record  results of devices' trials, on disk
"""
