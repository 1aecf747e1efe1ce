"""Numba's interpreter over rows: 64 lanes an instruction, compiled for the vectors of this machine.

No fast mathematics: the numbers must be ours.
"""

import numpy as np
from numba import njit

from programs import DIVISION, REGISTERS, SMALLEST_DIVISOR

LANES = 64
WORST = 2e6  # what the engine gives a prediction that is not finite, or worse than this


def blocks(rows: np.ndarray) -> np.ndarray:
    """Rows (n, columns) as contiguous blocks (blocks, columns, LANES); the last row fills what is left."""
    count = -(-len(rows) // LANES)
    padded = np.vstack([rows, np.repeat(rows[-1:], count * LANES - len(rows), axis=0)])
    return np.ascontiguousarray(padded.reshape(count, LANES, -1).transpose(0, 2, 1))


@njit(error_model="numpy")
def one_step_errors(operations, destinations, firsts, seconds, finals, inputs, nexts, rows):
    """Mean squared error of each program. `finals` says where each register is at the end."""
    programs, instructions = operations.shape
    states = nexts.shape[1]
    errors = np.zeros(programs)
    bank = np.zeros((REGISTERS + 1, LANES))
    squares = np.zeros(LANES)
    for p in range(programs):
        total = 0.0
        for block in range(inputs.shape[0]):
            bank[: inputs.shape[1]] = inputs[block]
            bank[inputs.shape[1] :] = 0.0
            for k in range(instructions):
                operation, d, a, b = operations[p, k], destinations[p, k], firsts[p, k], seconds[p, k]
                if operation == 0:
                    for lane in range(LANES):
                        bank[d, lane] = bank[a, lane] + bank[b, lane]
                elif operation == 1:
                    for lane in range(LANES):
                        bank[d, lane] = bank[a, lane] - bank[b, lane]
                elif operation == 2:
                    for lane in range(LANES):
                        bank[d, lane] = bank[a, lane] * bank[b, lane]
                elif operation == DIVISION:
                    for lane in range(LANES):
                        y = bank[b, lane]
                        bank[d, lane] = bank[a, lane] / (y if abs(y) > SMALLEST_DIVISOR else 1.0)
            squares[:] = 0.0
            for state in range(states):
                output = bank[finals[p, inputs.shape[1] + state]]
                for lane in range(LANES):
                    error = output[lane] - nexts[block, state, lane]
                    squares[lane] += error * error
            for lane in range(min(LANES, rows - block * LANES)):
                total += squares[lane]
        mean = total / (rows * states)
        errors[p] = mean if mean < WORST else WORST
    return errors
