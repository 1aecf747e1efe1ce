"""Logs of flights, read and written."""

from twinloop.logs.files import MOST_BYTES, Log, load, read_log, write_columns
from twinloop.logs.table import TIME
from twinloop.logs.ulog import Window

__all__ = ["MOST_BYTES", "TIME", "Log", "Window", "load", "read_log", "write_columns"]
