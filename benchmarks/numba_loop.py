"""Numba's closed loop: PID, mixer, model and error of several tests in one compiled function, a test a lane.

The steps and their order are those of the engine, so that the numbers are; only the watch for diverging runs
is left out, in numba's favour.
"""

from math import sqrt

import numpy as np
from numba import njit

from programs import DIVISION, REGISTERS, SMALLEST_DIVISOR

AHEAD = (0.5, 0.5, 1.0, 0.0)
WEIGHT = (1.0, 2.0, 2.0, 1.0)


def compiled(lanes: int):
    """The function for a number of lanes, which the compiler then knows."""
    LANES = lanes

    @njit(error_model="numpy")
    def run_program(operations, destinations, firsts, seconds, bank):
        for k in range(operations.shape[0]):
            operation, d, a, b = operations[k], destinations[k], firsts[k], seconds[k]
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

    @njit(error_model="numpy")
    def closed_loop_errors(
        operations,
        destinations,
        firsts,
        seconds,
        finals,
        gains,
        target,
        recorded,
        matrix,
        offset,
        bounds,
        scale,
        dt,
    ):
        """Mean squared error (programs, LANES) of gains (9, LANES) against recorded (steps + 1, 6, LANES)."""
        programs, steps = operations.shape[0], recorded.shape[0] - 1
        errors = np.zeros((programs, LANES))
        state, point, slope = np.zeros((6, LANES)), np.zeros((6, LANES)), np.zeros((6, LANES))
        total = np.zeros((6, LANES))
        integral, output = np.zeros((3, LANES)), np.zeros((3, LANES))
        command, squares = np.zeros((4, LANES)), np.zeros(LANES)
        bank = np.zeros((REGISTERS + 1, LANES))
        factor = 1.0 / scale
        for p in range(programs):
            state[:] = recorded[0]
            integral[:] = 0.0
            squares[:] = 0.0
            for step in range(steps):
                for axis in range(3):
                    for lane in range(LANES):
                        error = target[axis] - state[axis, lane]
                        integral[axis, lane] += error * dt
                        output[axis, lane] = (
                            gains[3 * axis, lane] * error
                            + gains[3 * axis + 1, lane] * integral[axis, lane]
                            - gains[3 * axis + 2, lane] * state[3 + axis, lane]
                        )
                for i in range(4):
                    for lane in range(LANES):
                        v = offset[i]
                        v += output[0, lane] * matrix[i, 0]
                        v += output[1, lane] * matrix[i, 1]
                        v += output[2, lane] * matrix[i, 2]
                        root = sqrt(abs(v))
                        v = -root if v < 0.0 else root
                        v = bounds[0] if v < bounds[0] else v
                        v = bounds[1] if bounds[1] < v else v
                        command[i, lane] = v * factor
                point[:] = state
                for stage in range(4):
                    bank[:6] = point
                    bank[6:10] = command
                    bank[10:] = 0.0
                    run_program(operations[p], destinations[p], firsts[p], seconds[p], bank)
                    for j in range(3):
                        slope[j] = point[3 + j]
                        slope[3 + j] = bank[finals[p, 10 + j]]
                    ahead, weight = AHEAD[stage] * dt, WEIGHT[stage]
                    for j in range(6):
                        for lane in range(LANES):
                            weighted = slope[j, lane] * weight
                            total[j, lane] = weighted if stage == 0 else total[j, lane] + weighted
                            point[j, lane] = state[j, lane] + slope[j, lane] * ahead
                for lane in range(LANES):
                    square = 0.0
                    for j in range(6):
                        state[j, lane] += total[j, lane] * (dt / 6.0)
                        error = state[j, lane] - recorded[step + 1, j, lane]
                        square += error * error
                    squares[lane] += square
            for lane in range(LANES):
                errors[p, lane] = squares[lane] / (steps * 6)
        return errors

    return closed_loop_errors
