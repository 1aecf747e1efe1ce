//! The engine's arithmetic as one would write it without lanes, in plain loops over numbers.

use twinloop_core::{Form, Instruction, Operand, Operation, Program};

use crate::worlds::World;

/// Whether two numbers have the same bits; the payload of a NaN is the one thing that a processor may choose.
pub fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}

/// Whether all numbers have the same bits.
pub fn all_same(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(*a, *b))
}

/// Whether two numbers differ by a rounding at most.
pub fn close(a: f64, b: f64) -> bool {
    a == b || (a - b).abs() <= 1e-12 * a.abs().max(b.abs())
}

/// The outputs of instructions that are run one after another, introns and all.
pub fn evaluate(program: &Program, inputs: &[f64]) -> Vec<f64> {
    let shape = program.shape();
    let mut registers = vec![0.0; shape.registers];
    registers[..inputs.len()].copy_from_slice(inputs);
    for Instruction { operation, destination, first, second } in program.instructions() {
        let a = registers[usize::from(*first)];
        let b = match second {
            None => f64::NAN,
            Some(Operand::Register(register)) => registers[usize::from(*register)],
            Some(Operand::Constant(constant)) => *constant,
        };
        registers[usize::from(*destination)] = match operation {
            Operation::Add => a + b,
            Operation::Sub => a - b,
            Operation::Mul => a * b,
            Operation::Div if b.abs() > 1e-6 => a / b,
            Operation::Div => a,
            Operation::Min if a < b => a,
            Operation::Max if a > b => a,
            Operation::Min | Operation::Max => b,
            Operation::Sin => libm::sin(a),
            Operation::Cos => libm::cos(a),
            Operation::Tanh => libm::tanh(a),
            Operation::Exp => libm::exp(a),
            Operation::Sqrt => a.abs().sqrt(),
            Operation::Abs => a.abs(),
        };
    }
    registers[shape.output_registers()].to_vec()
}

/// The next state that a program means in a form.
pub fn step(world: &World, program: &Program, form: Form, state: &[f64], command: &[f64]) -> Vec<f64> {
    let signals = &world.signals;
    let outputs = |state: &[f64]| {
        let scaled = command.iter().zip(&signals.command_scales).map(|(command, scale)| command / scale);
        evaluate(program, &state.iter().copied().chain(scaled).collect::<Vec<_>>())
    };
    match form {
        Form::Absolute => outputs(state),
        Form::Increment => sum(state, &outputs(state), 1.0),
        Form::Acceleration => rk4(state, signals.dt, |state| {
            let mut outputs = outputs(state).into_iter();
            let derivative = |of| match signals.derivative_of.iter().position(|&d| d == Some(of)) {
                Some(rate) => state[rate],
                None => outputs.next().unwrap(),
            };
            (0..state.len()).map(derivative).collect()
        }),
        Form::ExplicitEuler | Form::SemiImplicitEuler => {
            let mut next = state.to_vec();
            let given = |of| signals.derivative_of.iter().position(|&d| d == Some(of));
            let driven = (0..state.len()).filter(|&of| given(of).is_none());
            driven.zip(outputs(state)).for_each(|(of, output)| next[of] += output * signals.dt);
            for of in 0..state.len() {
                if let Some(rate) = given(of) {
                    // The world has no rate that is given itself.
                    let rates = if form == Form::ExplicitEuler { state } else { &next };
                    next[of] = state[of] + rates[rate] * signals.dt;
                }
            }
            next
        }
    }
}

/// The classical Runge–Kutta step.
pub fn rk4(x: &[f64], dt: f64, mut f: impl FnMut(&[f64]) -> Vec<f64>) -> Vec<f64> {
    let k1 = f(x);
    let k2 = f(&sum(x, &k1, 0.5 * dt));
    let k3 = f(&sum(x, &k2, 0.5 * dt));
    let k4 = f(&sum(x, &k3, dt));
    (0..x.len()).map(|j| x[j] + (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]) * (dt / 6.0)).collect()
}

fn sum(x: &[f64], k: &[f64], factor: f64) -> Vec<f64> {
    x.iter().zip(k).map(|(x, k)| x + k * factor).collect()
}

/// The PIDs of a world with their memory.
pub struct Pids<'a> {
    world: &'a World,
    gains: &'a [f64],
    integrals: Vec<f64>,
    last_angles: Vec<Option<f64>>,
}

impl<'a> Pids<'a> {
    pub fn new(world: &'a World, gains: &'a [f64]) -> Self {
        let axes = world.axes.len();
        Self { world, gains, integrals: vec![0.0; axes], last_angles: vec![None; axes] }
    }

    pub fn command(&mut self, state: &[f64], target: &[f64]) -> Vec<f64> {
        let World { axes, signals, .. } = self.world;
        let mut efforts = Vec::new();
        for (i, axis) in axes.iter().enumerate() {
            let angle = state[axis.state];
            let error = target[axis.state] - angle;
            self.integrals[i] += error * signals.dt;
            let rate = match (axis.rate, self.last_angles[i]) {
                (Some(rate), _) => state[rate],
                (None, None) => 0.0,
                (None, Some(last)) => (angle - last) / signals.dt,
            };
            self.last_angles[i] = Some(angle);
            let [proportional, integral, derivative] = self.gains[3 * i..][..3] else { unreachable!() };
            efforts.push(proportional * error + integral * self.integrals[i] - derivative * rate);
        }
        mix(self.world, &efforts)
    }
}

/// clip(sign(v) |v|^power) with v = offset + matrix · efforts.
fn mix(world: &World, efforts: &[f64]) -> Vec<f64> {
    let command = |(i, row): (usize, &Vec<f64>)| {
        let v = row.iter().zip(efforts).fold(world.offset[i], |v, (factor, effort)| v + effort * factor);
        let magnitude = match world.power {
            0.5 => v.abs().sqrt(),
            1.0 => v.abs(),
            power => libm::pow(v.abs(), power),
        };
        let (low, high) = world.signals.command_bounds[i];
        (if v < 0.0 { -magnitude } else { magnitude }).clamp(low, high)
    };
    world.matrix.iter().enumerate().map(command).collect()
}

/// What a closed loop leaves behind up to the step in which it diverges.
#[derive(Default)]
pub struct Run {
    pub states: Vec<Vec<f64>>,
    pub readings: Vec<Vec<f64>>,
    pub commands: Vec<Vec<f64>>,
    pub lasted: usize,
}

/// Closes the loop of a world's controller around anything that steps. `noise` is empty or a row for each state.
pub fn run(
    mut step: impl FnMut(&[f64], &[f64]) -> Vec<f64>,
    mut controller: Pids<'_>,
    [initial, target]: [&[f64]; 2],
    steps: usize,
    limits: &[f64],
    noise: &[f64],
) -> Run {
    let mut run = Run { states: vec![initial.to_vec()], ..Run::default() };
    while run.lasted < steps {
        let state = &run.states[run.lasted];
        let noise = noise.chunks(state.len()).nth(run.lasted);
        let reading = noise.map_or_else(|| state.clone(), |noise| sum(state, noise, 1.0));
        let command = controller.command(&reading, target);
        let next = step(state, &command);
        let diverged = !next.iter().zip(limits).all(|(x, limit)| x.abs() < *limit);
        run.readings.push(reading);
        run.commands.push(command);
        run.states.push(next);
        if diverged {
            break;
        }
        run.lasted += 1;
    }
    run
}
