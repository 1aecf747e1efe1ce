//! A small world to test in, and strategies for what lives there: programs, gains, experiments.

use std::ops::Range;
use std::sync::Arc;

use proptest::prelude::*;
use twinloop_core::{
    Axis, Experiment, Family, Form, Gain, Grammar, Instruction, Limits, Mixer, Operand, Operation, Page,
    Periods, Pid, Program, SelectedTests, Setting, Shape, Signals, Width, Workers,
};

/// Three states, the second the derivative of the first; two commands; one axis with a rate and one without.
pub struct World {
    pub signals: Arc<Signals>,
    pub family: Arc<Family>,
    pub axes: Vec<Axis>,
    pub matrix: Vec<Vec<f64>>,
    pub offset: Vec<f64>,
    pub power: f64,
}

pub const STATES: usize = 3;
pub const COMMANDS: usize = 2;
pub const GAINS: usize = 6;

impl World {
    pub fn new() -> Self {
        Self::with_power(1.0)
    }

    pub fn with_power(power: f64) -> Self {
        let signals = Signals {
            dt: 0.05,
            state_scales: vec![1.0, 2.0, 1.5],
            command_bounds: vec![(-1.0, 1.0), (-2.0, 3.0)],
            // Powers of two: dividing by them and multiplying by their inverse is the same.
            command_scales: vec![0.5, 2.0],
            derivative_of: vec![None, Some(0), None],
            kinematics: None,
            periods: Periods::default(),
        };
        let signals = Arc::new(signals.validated().unwrap());
        let axes = vec![axis(0, Some(1)), axis(2, None)];
        let (matrix, offset) = (vec![vec![1.0, 0.5], vec![-0.25, 2.0]], vec![0.1, -0.2]);
        let output =
            Mixer::new(matrix.clone(), offset.clone(), power, signals.command_bounds.clone(), axes.len());
        let pid = Pid::new(axes.clone(), output.unwrap(), signals.dt);
        let gains = [4.0, 2.0, 1.0, 4.0, 2.0, 1.0].map(|high| free(0.0, high)).to_vec();
        let family = Arc::new(Family::new(pid, gains, STATES).unwrap());
        Self { signals, family, axes, matrix, offset, power }
    }

    /// Registers of a program in a form, three of them spare.
    pub fn shape(&self, form: Form) -> Shape {
        let (inputs, outputs) = form.shape(&self.signals);
        Shape::new(inputs, outputs, 3).unwrap()
    }

    pub fn limits(&self, divergence_factor: f64) -> Limits {
        Limits::new(self.signals.clone(), divergence_factor).unwrap()
    }

    pub fn setting(&self, divergence_factor: f64) -> Arc<Setting> {
        Arc::new(Setting::new(self.limits(divergence_factor), self.family.clone()).unwrap())
    }

    /// The same, where a run has diverged at these magnitudes of the states.
    pub fn within(self, magnitudes: Vec<f64>) -> Self {
        let signals = Signals { state_scales: magnitudes, ..(*self.signals).clone() };
        Self { signals: Arc::new(signals), ..self }
    }

    pub fn no_tests(&self) -> SelectedTests {
        SelectedTests::new(self.setting(10.0))
    }

    pub fn selected(&self, experiments: &[Experiment]) -> SelectedTests {
        experiments.iter().fold(self.no_tests(), |tests, one| tests.with_test(one.clone()).unwrap())
    }
}

/// An axis whose set point is the target.
pub fn axis(state: usize, rate: Option<usize>) -> Axis {
    Axis { state, rate, outer: None }
}

/// A gain between bounds, on a linear scale.
pub fn free(low: f64, high: f64) -> Gain {
    Gain::Free { low, high, logarithmic: false }
}

pub fn one_worker() -> Workers {
    Workers::new(1, Width::widest()).unwrap()
}

pub fn grammar(shape: Shape) -> Grammar {
    Grammar {
        shape,
        pages: 4,
        page_length: 6,
        operations: Operation::ALL.to_vec(),
        writable_inputs: true,
        constant_share: 0.5,
        constant_magnitudes: (1e-3, 10.0),
        constant_step: 0.1,
        mutation_rate: 0.05,
        aligned_pages: 0.5,
    }
}

/// Any instruction over the registers of a shape.
pub fn instruction(shape: Shape) -> impl Strategy<Value = Instruction> {
    let register = 0..shape.registers as u16;
    let constant = prop_oneof![-2.0..2.0, any::<f64>().prop_filter("finite", |x| x.is_finite())];
    let operand =
        prop_oneof![register.clone().prop_map(Operand::Register), constant.prop_map(Operand::Constant)];
    (prop::sample::select(Operation::ALL.to_vec()), register.clone(), register, operand).prop_map(
        |(operation, destination, first, second)| Instruction {
            operation,
            destination,
            first,
            second: (!operation.is_unary()).then_some(second),
        },
    )
}

/// Any program of a shape: up to four pages, some of them empty.
pub fn program_of(shape: Shape) -> impl Strategy<Value = Program> {
    let page = prop::collection::vec(instruction(shape), 0..12).prop_map(Page);
    prop::collection::vec(page, 0..5).prop_map(move |pages| Program::new(shape, pages).unwrap())
}

/// Any program.
pub fn any_program() -> impl Strategy<Value = Program> {
    (1..5_usize, 1..4_usize, 0..4_usize)
        .prop_flat_map(|(inputs, outputs, spare)| program_of(Shape::new(inputs, outputs, spare).unwrap()))
}

/// A form and a program that fits it in the world.
pub fn any_model() -> impl Strategy<Value = (Form, Program)> {
    prop::sample::select(Form::ALL.to_vec())
        .prop_flat_map(|form| (Just(form), program_of(World::new().shape(form))))
}

/// Gains in and around the box.
pub fn gains() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-1.0..5.0, GAINS)
}

pub fn state() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-1.0..1.0, STATES)
}

/// A recording of so many steps, of numbers that no system produced.
pub fn experiment(steps: Range<usize>) -> impl Strategy<Value = Experiment> {
    steps.prop_flat_map(|steps| {
        let states = prop::collection::vec(-1.0..1.0, (steps + 1) * STATES);
        let commands = prop::collection::vec(-2.0..2.0, steps * COMMANDS);
        (gains(), state(), states, commands).prop_map(|(parameters, target, states, commands)| Experiment {
            parameters,
            target,
            states,
            commands,
            excitation: vec![],
            hold_back: None,
        })
    })
}
