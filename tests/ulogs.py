"""Writes logs of PX4 by hand, byte for byte after its specification (docs.px4.io, ULog file format)."""

import struct

MAGIC = b"ULog\x01\x12\x35\x01"


def message(kind, body):
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog(formats, rows, start=1_000_000, tail=b""):
    """A log.

    `formats`: text of each topic's fields by name; `rows`: (time in s after the beginning, topic, instance, values),
    all values doubles.
    """
    found = MAGIC + struct.pack("<Q", start) + message("B", bytes(40))
    for name, fields in formats.items():
        found += message("F", f"{name}:{fields}".encode())
    known = sorted({(topic, instance) for _, topic, instance, _ in rows})
    for number, (topic, instance) in enumerate(known):
        found += message("A", struct.pack("<BH", instance, number) + topic.encode())
    for time, topic, instance, values in rows:
        stamp = struct.pack("<Q", start + round(1e6 * time))
        body = (
            struct.pack("<H", known.index((topic, instance)))
            + stamp
            + struct.pack(f"<{len(values)}d", *values)
        )
        found += message("D", body)
    return found + tail
