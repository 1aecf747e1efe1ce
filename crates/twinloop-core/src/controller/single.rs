//! One controller of a family with its memory, as it runs on a real system.

use std::sync::Arc;

use super::{Controllers, Family};
use crate::error::{Result, invalid};
use crate::excitation::{Excitation, HoldBack};
use crate::lanes::{Scalar, Vector};

/// Parameters and memory; the law is the family's, the same that the search runs on lanes.
pub struct Controller {
    family: Arc<Family>,
    parameters: Vec<Scalar>,
    running: Controllers<Scalar>,
    /// What is added to the commands, n × n_u; nothing after the last row.
    excitation: Vec<Scalar>,
    /// Lines of what holds it back; empty for nothing.
    hold_back: Vec<Scalar>,
    /// Commands given since the start of the run.
    period: usize,
}

impl Controller {
    /// A controller at the start of a run.
    pub fn new(family: Arc<Family>, parameters: Vec<f64>) -> Result<Self> {
        let expected = family.parameters().len();
        if parameters.len() != expected || !parameters.iter().all(|x| x.is_finite()) {
            return invalid(format!(
                "controller: expected {expected} finite parameters, found {parameters:?}"
            ));
        }
        let parameters = lanes(&parameters);
        let (running, excitation, hold_back) = (family.start(&parameters), vec![], vec![]);
        Ok(Self { running, parameters, excitation, hold_back, period: 0, family })
    }

    /// The same with an excitation (n × n_u): a row is added to the command of each period, then the bounds clip it.
    /// What is read may hold it back.
    pub fn excited(self, excitation: &[f64], hold_back: Option<&HoldBack>) -> Result<Self> {
        let commands = self.family.commands();
        if !excitation.len().is_multiple_of(commands) || !excitation.iter().all(|x| x.is_finite()) {
            return invalid(format!(
                "controller: expected an excitation of n × {commands} finite numbers, found {} numbers; give a row \
                 for each period",
                excitation.len()
            ));
        }
        hold_back.map_or(Ok(()), |found| found.check(self.family.states()))?;
        let hold_back = hold_back.map_or_else(Vec::new, |found| lanes(found.lines()));
        Ok(Self { excitation: lanes(excitation), hold_back, ..self })
    }

    /// The same in the midst of the same run, with a memory of its own.
    pub fn copied(&self) -> Self {
        Self {
            family: self.family.clone(),
            parameters: self.parameters.clone(),
            running: self.running.copied(),
            excitation: self.excitation.clone(),
            hold_back: self.hold_back.clone(),
            period: self.period,
        }
    }

    /// The parameter vector (size).
    pub fn parameters(&self) -> impl Iterator<Item = f64> {
        self.parameters.iter().map(|lane| lane.lane(0))
    }

    /// Back to the start of a run.
    pub fn reset(&mut self) {
        self.running.reset();
        self.period = 0;
    }

    /// The command (n_u) for a state and a target (n_x); to be called once a period.
    pub fn command(&mut self, state: &[f64], target: &[f64]) -> Result<Vec<f64>> {
        let expected = self.family.states();
        if state.len() != expected || target.len() != expected {
            let (state, target) = (state.len(), target.len());
            return invalid(format!(
                "controller: expected {expected} states and targets, found {state} and {target}"
            ));
        }
        if !state.iter().chain(target).all(|x| x.is_finite()) {
            return invalid(
                "controller: expected finite states and targets, found NaN or an infinite one; stop the run",
            );
        }
        let mut command = vec![Scalar::splat(0.0); self.family.commands()];
        let reading = lanes(state);
        self.family.command(&mut self.running, &reading, &lanes(target), &mut command);
        let excitation = Excitation { rows: &self.excitation, hold_back: &self.hold_back };
        excitation.add(&self.family, self.period, &reading, &mut command);
        self.period += 1;
        Ok(command.iter().map(|lane| lane.lane(0)).collect())
    }
}

fn lanes(values: &[f64]) -> Vec<Scalar> {
    values.iter().map(|&value| Scalar::splat(value)).collect()
}
