"""Time against achieved error: python bench/backproject.py [options], the same as `sarcl bench backproject`."""

import sys

from sarcl.cli.parser import main

if __name__ == "__main__":
    sys.exit(main(["bench", "backproject", *sys.argv[1:]]))
