//! A model that owns what it is made of: what is handed on between searches, committees and flights.

use std::sync::Arc;

use super::{Form, Frame, Model};
use crate::actuators::Actuation;
use crate::error::{Result, invalid};
use crate::levels::Levels;
use crate::lgp::Learnt;
use crate::reports::{Report, Reports};
use crate::sensors::Sensors;
use crate::signals::Signals;

/// A program, the frame that makes it dynamics, and the signals that it is for.
#[derive(Clone, Debug)]
pub struct OwnedModel {
    learnt: Arc<Learnt>,
    frame: Arc<Frame>,
    signals: Arc<Signals>,
}

impl OwnedModel {
    /// A program in a form; behind an actuator for each command, where there are any.
    pub fn new(
        learnt: Arc<Learnt>,
        form: Form,
        signals: Arc<Signals>,
        actuation: Option<Actuation>,
    ) -> Result<Self> {
        let hidden = actuation.as_ref().map_or(0, |actuation| actuation.hidden.len());
        Model::check(&learnt.program, form, &signals, hidden)?;
        let frame = Frame::new(form, &signals);
        let frame = match actuation {
            None => frame,
            Some(actuation) => frame.with_actuation(actuation)?,
        };
        Ok(Self::of(learnt, Arc::new(frame), signals))
    }

    /// A program that was learnt in a frame.
    pub(crate) fn of(learnt: Arc<Learnt>, frame: Arc<Frame>, signals: Arc<Signals>) -> Self {
        Self { learnt, frame, signals }
    }

    /// The same, of which each state is read so many s later (n_x).
    pub fn with_offsets(&self, offsets: &[f64]) -> Result<Self> {
        self.read_by(offsets, self.frame.sensors().reports().clone())
    }

    /// The same, of whose readings so much is given.
    pub fn with_reports(&self, reports: Vec<(usize, Report)>) -> Result<Self> {
        let reports = Reports::new(reports, self.signals.states())?;
        match self.frame.sensors().offsets() {
            [] => self.read_by(&vec![0.0; self.signals.states()], reports),
            offsets => self.read_by(offsets, reports),
        }
    }

    fn read_by(&self, offsets: &[f64], reports: Reports) -> Result<Self> {
        let sensors = Sensors::new(offsets, &self.signals)?.with_reports(reports);
        Ok(Self { frame: Arc::new((*self.frame).clone().with_sensors(sensors)), ..self.clone() })
    }

    /// The same, with controllers' commands sent in levels, or none of a command that is sent as it is (n_u).
    pub fn with_levels(&self, levels: Vec<Vec<f64>>) -> Result<Self> {
        let levels = Levels::new(levels, self.signals.commands())?;
        Ok(Self { frame: Arc::new((*self.frame).clone().with_levels(levels)), ..self.clone() })
    }

    /// The same without introns, with these constants, lags and times of hidden states.
    pub fn varied(&self, constants: &[f64], times: &[f64]) -> Result<Self> {
        let program = self.learnt.program.effective().with_constants(constants)?;
        let actuation = self.frame.actuation().with_times(times)?;
        let frame = if actuation.is_direct() {
            self.frame.clone()
        } else {
            Arc::new((*self.frame).clone().with_actuation(actuation)?)
        };
        Ok(Self::of(Arc::new(Learnt::new(program)), frame, self.signals.clone()))
    }

    /// Refuses signals of other states or commands, another period or other derivatives.
    pub fn check_for(&self, signals: &Signals) -> Result<()> {
        if self.frame.fits(signals) {
            return Ok(());
        }
        invalid(
            "model: expected one with the states, commands and period of the signals, found another; make or learn it \
             for them",
        )
    }

    /// What runs it.
    pub fn view(&self) -> Model<'_> {
        Model { code: &self.learnt.code, frame: &self.frame }
    }

    /// Its program.
    pub fn learnt(&self) -> &Arc<Learnt> {
        &self.learnt
    }

    /// What makes the program dynamics.
    pub fn frame(&self) -> &Arc<Frame> {
        &self.frame
    }

    /// What it is a model of.
    pub fn signals(&self) -> &Arc<Signals> {
        &self.signals
    }
}

/// Views of models that are for these signals.
pub fn views<'a>(
    models: impl IntoIterator<Item = &'a OwnedModel>,
    signals: &Signals,
) -> Result<Vec<Model<'a>>> {
    models.into_iter().map(|model| model.check_for(signals).map(|()| model.view())).collect()
}
