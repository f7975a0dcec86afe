"""The command line.

For other folders:

    parser      main(): arguments, options, exit status

For this folder alone:

    _commands   what each command does
    _job        output files and interruption of a command
    _methods    the methods of sarcl focus: options, plan, image
"""

__all__ = ["parser"]
