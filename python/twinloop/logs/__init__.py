"""Logs of flights, read and written."""

from twinloop.logs.even_times import evenly
from twinloop.logs.files import MOST_BYTES, Log, load, read_log, write_columns
from twinloop.logs.headers import refuse_others
from twinloop.logs.samples import Window
from twinloop.logs.table import TIME

__all__ = [
    "MOST_BYTES",
    "TIME",
    "Log",
    "Window",
    "evenly",
    "load",
    "read_log",
    "refuse_others",
    "write_columns",
]
