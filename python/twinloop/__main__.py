"""Lets `python -m twinloop` be the command `twinloop`."""

from twinloop.faces.cli import main

if __name__ == "__main__":
    main()
