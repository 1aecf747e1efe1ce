"""What the engine should compute, written once more in plain NumPy, slowly and from the specification."""

import ast
import math

import numpy as np

BINARY = ("+", "-", "*", "/", "min", "max")
UNARY = ("sin", "cos", "tanh", "exp", "sqrt", "abs")
EXACT = ("+", "-", "*", "/", "min", "max", "abs", "sqrt")
"""Operations whose result is determined to the last bit by IEEE 754."""


def operate(name, a, b=None):
    """One operation; division leaves the dividend as it is where the divisor is small."""
    with np.errstate(all="ignore"):
        match name:
            case "+":
                return np.add(a, b)
            case "-":
                return np.subtract(a, b)
            case "*":
                return np.multiply(a, b)
            case "/":
                return np.where(np.abs(b) > 1e-6, np.divide(a, b), a)
            case "min":
                return np.where(np.less(a, b), a, b)
            case "max":
                return np.where(np.greater(a, b), a, b)
            case "sqrt":
                return np.sqrt(np.abs(a))
            case "abs" | "sin" | "cos" | "tanh" | "exp":
                return getattr(np, name)(a)
    raise AssertionError(name)


def registers_of(program, inputs):
    """Yields the registers (registers, rows) before the first instruction and after each one."""
    inputs = np.asarray(inputs, dtype=float)
    bank = np.zeros((program.registers, len(inputs)))
    bank[: program.inputs] = inputs.T
    yield bank.copy()
    for name, destination, first, second in program.instructions:
        if second is None:
            bank[destination] = operate(name, bank[first])
        else:
            operand = bank[second] if isinstance(second, int) else np.full(len(inputs), second)
            bank[destination] = operate(name, bank[first], operand)
        yield bank.copy()


def run_program(program, inputs):
    """Outputs (rows, outputs) of inputs (rows, inputs), introns and all."""
    for bank in registers_of(program, inputs):
        last = bank
    return last[program.inputs : program.inputs + program.outputs].T


def needed(program):
    """Which instructions have a path to an output, forwards along the graph of who reads whose result."""
    writer = dict.fromkeys(range(program.registers))
    readers = {i: set() for i in range(len(program))}
    for i, (_, destination, first, second) in enumerate(program.instructions):
        for register in (first, second):
            if isinstance(register, int) and writer[register] is not None:
                readers[writer[register]].add(i)
        writer[destination] = i
    goals = {writer[program.inputs + k] for k in range(program.outputs)}

    def reaches(start):
        waiting, seen = [start], set()
        while waiting:
            i = waiting.pop()
            if i in goals:
                return True
            if i not in seen:
                seen.add(i)
                waiting += readers[i]
        return False

    return [reaches(i) for i in range(len(program))]


def rk4(derivative, state, dt):
    """The classical step of order four."""
    k1 = derivative(state)
    k2 = derivative(state + dt / 2 * k1)
    k3 = derivative(state + dt / 2 * k2)
    k4 = derivative(state + dt * k3)
    return state + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


FINE = 40
"""Steps of `solved` in a period: of periods of a fiftieth of a motion they are exact to rounding."""


def solved(slope, start, times):
    """A solution at times (n, n_x), to rounding, with the same bits on any processor: SciPy has those of its BLAS.

    What is learnt of exact readings hangs on their last bits.
    """
    states, dt = [np.array(start, dtype=np.float64)], (times[1] - times[0]) / FINE
    for _ in times[1:]:
        state = states[-1]
        for _ in range(FINE):
            state = rk4(lambda x: np.array(slope(*x.tolist())), state, dt)
        states.append(state)
    return np.array(states)


def model_step(program, form, state, command, scales, derivative_of, dt):
    """Next state under a program of any form."""
    state = np.asarray(state, dtype=float)
    seen = np.asarray(command) * (1.0 / np.asarray(scales))

    def outputs(x):
        return run_program(program, [np.concatenate([x, seen])])[0]

    with np.errstate(all="ignore"):
        if form == "absolute":
            return outputs(state)
        if form == "increment":
            return state + outputs(state)
        rate_of = {of: rate for rate, of in enumerate(derivative_of) if of is not None}
        if form.endswith("euler"):
            return euler(form, outputs(state), state, rate_of, dt)

        def derivative(x):
            rest = iter(outputs(x))
            return np.array([x[rate_of[i]] if i in rate_of else next(rest) for i in range(len(x))])

        return rk4(derivative, state, dt)


def euler(form, slopes, state, rate_of, dt):
    """One step of Euler, explicit or semi-implicit."""
    after, rest = state.copy(), iter(slopes)
    for i in range(len(state)):
        if i not in rate_of:
            after[i] = state[i] + next(rest) * dt
    moving = state if form == "explicit-euler" else after
    # Semi-implicit, a rate is moved before what it is the rate of.
    depth = {i: 0 for i in range(len(state)) if i not in rate_of}
    while len(depth) < len(state):
        depth |= {i: depth[rate] + 1 for i, rate in rate_of.items() if rate in depth and i not in depth}
    for i in sorted(rate_of, key=depth.get):
        after[i] = state[i] + moving[rate_of[i]] * dt
    return after


class Pid:
    """A PID an axis: integral updated before it is used, derivative on the measurement, then the map.

    An axis is (state, rate or None), or (rate, None, angle, limit) inside a loop that asks it for a rate.
    """

    def __init__(
        self, axes, gains, dt, matrix, offset, power, bounds, derivative_filter=0.0, anti_windup=False
    ):
        self.axes, self.dt, self.power = axes, dt, power
        gains = iter(gains)
        self.gains = [[next(gains) for _ in range(3 if len(axis) == 2 else 4)] for axis in axes]
        self.matrix, self.offset, self.bounds = np.asarray(matrix), np.asarray(offset), np.asarray(bounds)
        self.filter, self.anti_windup = derivative_filter, anti_windup
        self.integral = np.zeros(len(axes))
        self.last = [None] * len(axes)
        self.filtered = [None] * len(axes)

    def rate(self, i, state):
        """The rate of an axis: measured or differenced, then filtered from the first one on."""
        place, measured, *_ = self.axes[i]
        if measured is not None:
            rate = state[measured]
        else:
            rate = 0.0 if self.last[i] is None else (state[place] - self.last[i]) / self.dt
            self.last[i] = state[place]
        if self.filter > 0.0:
            before = rate if self.filtered[i] is None else self.filtered[i]
            rate = before + self.dt / (self.dt + self.filter) * (rate - before)
            self.filtered[i] = rate
        return rate

    def command(self, state, target):
        u, before = np.empty(len(self.axes)), self.integral.copy()
        for i, (axis, gains) in enumerate(zip(self.axes, self.gains, strict=True)):
            kp, ki, kd = gains[-3:]
            set_point = target[axis[0]]
            if len(axis) == 4:
                angle, limit = axis[2:]
                set_point = np.clip(gains[0] * (target[angle] - state[angle]) + set_point, -limit, limit)
            error = set_point - state[axis[0]]
            self.integral[i] += error * self.dt
            u[i] = kp * error + ki * self.integral[i] - kd * self.rate(i, state)
        v = self.offset.copy()
        for i in range(len(u)):
            v = v + self.matrix[:, i] * u[i]
        with np.errstate(all="ignore"):
            raised = v if self.power == 1.0 else np.sign(v) * np.abs(v) ** self.power
        if self.anti_windup:
            self.unwind(before, raised)
        return np.clip(raised, self.bounds[:, 0], self.bounds[:, 1])

    def unwind(self, before, raised):
        """Takes back the step of an integral that pushed a command out of its bounds, or further out."""
        for i, gains in enumerate(self.gains):
            push = self.matrix[:, i] * gains[-2] * (self.integral[i] - before[i])
            beyond = ((raised >= self.bounds[:, 1]) & (push > 0)) | (
                (raised <= self.bounds[:, 0]) & (push < 0)
            )
            if beyond.any():
                self.integral[i] = before[i]


def close_loop(
    step, controller, initial, target, steps, limits, noise=None, excitation=None, disturbance=None
):
    """States, readings, commands of a run, and how many steps it lasted; cut where it diverged."""
    state = np.asarray(initial, dtype=float)
    noise = np.zeros((steps + 1, len(state))) if noise is None else noise
    states, readings, commands = [state], [state + noise[0]], []
    for k in range(steps):
        command = controller.command(readings[-1], target)
        if excitation is not None:
            command = np.clip(command + excitation[k], controller.bounds[:, 0], controller.bounds[:, 1])
        state = np.asarray(step(state, command), dtype=float)
        if disturbance is not None:
            state = state + disturbance[k]
        if not (np.abs(state) < limits).all():
            break
        commands.append(command)
        states.append(state)
        readings.append(state + noise[k + 1])
    commands = np.array(commands).reshape(-1, len(controller.bounds))
    return np.array(states), np.array(readings), commands, len(commands)


def quadrotor_derivative(state, speeds, roll_sign=1.0, inertia=(7.5e-3, 7.5e-3, 1.3e-2)):
    """Specification, section 5, with the constants of the OS4; pitch always has the minus."""
    arm, thrust, drag, rotor = 0.23, 3.13e-5, 7.5e-7, 6e-5
    ix, iy, iz = inertia
    _, _, _, p, q, r = state
    w1, w2, w3, w4 = speeds
    spin = -w1 + w2 - w3 + w4
    roll = arm * thrust * (w4**2 - w2**2)
    pitch = arm * thrust * (w1**2 - w3**2)
    yaw = drag * (-(w1**2) + w2**2 - w3**2 + w4**2)
    return np.array([
        p,
        q,
        r,
        roll / ix + roll_sign * rotor * spin / ix * q + q * r * (iy - iz) / ix,
        pitch / iy - rotor * spin / iy * p + p * r * (iz - ix) / iy,
        yaw / iz + p * q * (ix - iy) / iz,
    ])  # fmt: skip


def dominates(a, b):
    return bool((a <= b).all() and (a < b).any())


def non_dominated(rows):
    """Numbers of the rows that nothing dominates; of equal rows the first."""
    rows = np.asarray(rows)
    return [
        i
        for i, row in enumerate(rows)
        if not any(dominates(other, row) for other in rows)
        and not any((other == row).all() for other in rows[:i])
    ]


def crowding(rows):
    """Crowding distances of one front (Deb et al. 2002); a column that is equal throughout says nothing."""
    rows = np.asarray(rows, dtype=float)
    distances = np.zeros(len(rows))
    if len(rows) <= 2:
        return np.full(len(rows), np.inf)
    for column in rows.T:
        extent = column.max() - column.min()
        if extent == 0.0:
            continue
        order = sorted(range(len(rows)), key=lambda i, c=column: (c[i], i))
        distances[order[0]] = distances[order[-1]] = np.inf
        for before, row, after in zip(order, order[1:], order[2:], strict=False):
            distances[row] += (column[after] - column[before]) / extent
    return distances


def same_bits(a, b):
    """Whether two arrays are equal to the last bit; one NaN is as good as another."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if a.shape != b.shape or not (np.isnan(a) == np.isnan(b)).all():
        return False
    return bool((a[~np.isnan(a)].view(np.int64) == b[~np.isnan(b)].view(np.int64)).all())


def evaluate(text, values):
    """The value of one printed expression; divisions are protected."""
    calls = {"Min": lambda a, b: operate("min", a, b), "Max": lambda a, b: operate("max", a, b)}
    calls |= {name: (lambda a, name=name: operate(name, a)) for name in UNARY}
    symbols = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}

    def value(node):
        match node:
            case ast.Constant(value=number):
                return float(number)
            case ast.Name(id=name):
                return values[name]
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -value(operand)
            case ast.BinOp(left=base, op=ast.Pow(), right=ast.Constant(value=int() as exponent)):
                return value(base) ** exponent
            case ast.BinOp(left=left, op=op, right=right):
                return operate(symbols[type(op)], value(left), value(right))
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return calls[name](*map(value, arguments))
        raise AssertionError(f"cannot read {ast.dump(node)} in {text!r}")

    return value(ast.parse(text, mode="eval").body)


def final_distance(state, target):
    return math.dist(state, target)
