"""Whether two values are the same to the last bit, and what another process would read of them."""

import copy
import dataclasses
import json
import math

import numpy as np

from twinloop import _core
from twinloop.identification.terms.pool import Pool


def through_json(record):
    """What another process would read."""
    return json.loads(json.dumps(record, allow_nan=False))


def same(a, b):
    """Equal to the bit, field by field; written apart from the plain form that is tested with it."""
    if isinstance(a, np.ndarray):
        numbers = [np.where(np.isnan(array), np.nan, array) for array in (a, b)]
        return a.shape == b.shape and numbers[0].tobytes() == numbers[1].tobytes()
    if isinstance(a, float):
        # Of the many NaN there is one in a record.
        bits = np.float64(a).tobytes() == np.float64(b).tobytes()
        return isinstance(b, float) and (bits or (math.isnan(a) and math.isnan(b)))
    if isinstance(a, _core.Model):
        parts = ("form", "actuators", "hidden")
        return str(a.program) == str(b.program) and all(same(getattr(a, p), getattr(b, p)) for p in parts)
    if isinstance(a, _core.Program):
        return str(a) == str(b)
    if isinstance(a, Pool):
        parts = ("inputs", "operations", "nodes", "rungs", "found", "one", "_numbers")
        return all(same(getattr(a, p), getattr(b, p)) for p in parts)
    if dataclasses.is_dataclass(a):
        names = [field.name for field in dataclasses.fields(a)]
        return type(a) is type(b) and all(same(getattr(a, n), getattr(b, n)) for n in names)
    if isinstance(a, dict):
        return list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if type(a).__module__ == "twinloop._core":
        return type(a) is type(b)  # numbers for the engine, made of what is compared already
    return type(a) is type(b) and a == b


def copied(a):
    """A copy that shares nothing that can change; what the native engine holds never does."""
    if type(a).__module__ == "twinloop._core":
        return a
    if isinstance(a, Pool):
        return copy.deepcopy(a)
    if dataclasses.is_dataclass(a):
        other = copy.copy(a)
        for field in dataclasses.fields(a):
            object.__setattr__(other, field.name, copied(getattr(a, field.name)))
        return other
    if isinstance(a, dict):
        return {key: copied(value) for key, value in a.items()}
    if isinstance(a, list) or type(a) is tuple:
        return type(a)(copied(value) for value in a)
    return copy.deepcopy(a)
