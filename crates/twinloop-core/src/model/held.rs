//! A model within a period, whose commands are held.

use super::Model;
use super::frame::Slope;
use crate::hidden::Storage;
use crate::integrator::{Field, Slopes};
use crate::lanes::Vector;
use crate::lgp::Bank;

/// A model in a period: the effect of the command is known at its start, middle and end.
pub(super) struct Held<'a, V> {
    pub model: &'a Model<'a>,
    pub bank: &'a mut Bank<V>,
    pub storage: &'a mut Option<Box<Storage<V>>>,
    pub effects: [&'a [V]; 3],
    pub stage: usize,
}

/// Which of the three effects each stage of the integrator sees.
const STAGES: [usize; 4] = [0, 1, 1, 2];

impl<V: Vector> Field<V> for Held<'_, V> {
    #[inline(always)]
    fn slope(&mut self, states: &[V], slopes: &mut Slopes<'_, V>) {
        let outputs = self.model.outputs(self.bank, self.storage, states, self.effects[STAGES[self.stage]]);
        self.stage += 1;
        let still = V::splat(0.0);
        for (j, source) in self.model.frame.slopes.iter().enumerate() {
            // A place and not a value, which would go by way of the stack.
            let slope = match *source {
                Slope::State(rate) => &states[rate],
                Slope::Output(output) => &outputs[output],
                Slope::Turn => &still,
            };
            slopes.put(j, *slope);
        }
    }
}
