"""The command line.

For other folders:

    parser      main(): arguments, options, exit status

For this folder alone:

    _commands   what each command does, and the table of devices
    _doctor     sarcl doctor: the machine, the packages and OpenCL on one screen
    _flags      options of the verbs as the parser needs them, made from their records
    _job        output files and interruption of a command
    _methods    the methods of sarcl focus: options, plan, image
    _pages      sarcl fda, papers and bench: pages and tables
"""
