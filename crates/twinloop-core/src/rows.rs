//! Rows: code and dynamics over many rows that know nothing of each other.

use crate::any_dynamics::AnyDynamics;
use crate::dynamics::{Dynamics, step_apart};
use crate::lanes::{Isa, Kernel, Vector, Width, dispatch, pack};
use crate::lgp::Code;

/// Outputs (rows × outputs) of code for each row of inputs.
pub fn run_rows(code: &Code, inputs: &[&[f64]], width: Width) -> Vec<f64> {
    dispatch(width, Run { code, inputs })
}

struct Run<'a> {
    code: &'a Code,
    inputs: &'a [&'a [f64]],
}

impl Kernel for Run<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<f64> {
        let mut bank = self.code.bank::<W::Of64>();
        let mut rows = Vec::new();
        for chunk in self.inputs.chunks(W::Of64::LANES) {
            let inputs: Vec<W::Of64> = pack(chunk);
            let outputs = self.code.run(&mut bank, &inputs);
            for l in 0..chunk.len() {
                rows.extend(outputs.iter().map(|output| output.lane(l)));
            }
        }
        rows
    }
}

/// Next states (rows × n_x) of each row of states under its row of commands. Each row is a run of its own, that began
/// with the commands of its row of the past (p × n_u, the oldest first), or begins now where there are none.
pub fn step_rows(
    dynamics: AnyDynamics<'_>,
    states: &[&[f64]],
    commands: &[&[f64]],
    past: &[&[f64]],
    width: Width,
) -> Vec<f64> {
    dispatch(width, Step { dynamics, states, commands, past })
}

struct Step<'a> {
    dynamics: AnyDynamics<'a>,
    states: &'a [&'a [f64]],
    commands: &'a [&'a [f64]],
    past: &'a [&'a [f64]],
}

impl Kernel for Step<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<f64> {
        let mut rows = Vec::new();
        let lanes = W::Of32::LANES;
        for (i, states) in self.states.chunks(lanes).enumerate() {
            let of_chunk = |all: &'_ [&'_ [f64]]| -> Vec<W::Of32> {
                if all.is_empty() { vec![] } else { pack(&all[i * lanes..][..states.len()]) }
            };
            let command = of_chunk(self.commands);
            // A fresh one: dynamics may remember, and a row knows nothing of the rows before it.
            let mut workspace = self.dynamics.workspace::<W::Of32>();
            for earlier in of_chunk(self.past).chunks_exact(command.len()) {
                self.dynamics.remember(&mut workspace, earlier);
            }
            let mut state: Vec<W::Of32> = pack(states);
            step_apart(&self.dynamics, &mut workspace, &mut state, &command);
            for l in 0..states.len() {
                rows.extend(state.iter().map(|state| state.lane(l)));
            }
        }
        rows
    }
}
