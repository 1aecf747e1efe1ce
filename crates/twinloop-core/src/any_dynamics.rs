//! Any dynamics: a model or a built-in plant, where both are flown by the same compiled loops.

use crate::dynamics::{Dynamics, step_apart};
use crate::lanes::Vector;
use crate::levels::Levels;
use crate::model::Model;
use crate::plants::Quadrotor;

/// What can be flown. Loops over this one type serve models and plants alike, for each copy takes its time to compile.
#[derive(Clone, Copy)]
pub enum AnyDynamics<'a> {
    /// Learnt.
    Model(Model<'a>),
    /// The built-in quadrotor.
    Quadrotor(&'a Quadrotor),
}

impl<'a> From<Model<'a>> for AnyDynamics<'a> {
    fn from(model: Model<'a>) -> Self {
        Self::Model(model)
    }
}

impl<'a> From<&'a Quadrotor> for AnyDynamics<'a> {
    fn from(plant: &'a Quadrotor) -> Self {
        Self::Quadrotor(plant)
    }
}

/// The workspace of the one that is flown.
#[expect(clippy::large_enum_variant, reason = "there is one for each roll-out, and it is never moved")]
pub enum AnyWorkspace<'a, V: Vector> {
    /// Of a model.
    Model(<Model<'a> as Dynamics>::Workspace<V>),
    /// Of the quadrotor.
    Quadrotor(<Quadrotor as Dynamics>::Workspace<V>),
}

impl<'a> Dynamics for AnyDynamics<'a> {
    type Workspace<V: Vector> = AnyWorkspace<'a, V>;

    fn workspace<V: Vector>(&self) -> AnyWorkspace<'a, V> {
        match self {
            Self::Model(model) => AnyWorkspace::Model(model.workspace()),
            Self::Quadrotor(plant) => AnyWorkspace::Quadrotor(plant.workspace()),
        }
    }

    #[inline(always)]
    fn remember<V: Vector>(&self, workspace: &mut AnyWorkspace<'a, V>, command: &[V]) {
        match (self, workspace) {
            (Self::Model(model), AnyWorkspace::Model(workspace)) => model.remember(workspace, command),
            (Self::Quadrotor(plant), AnyWorkspace::Quadrotor(workspace)) => {
                plant.remember(workspace, command);
            }
            _ => unreachable!("a workspace belongs to the dynamics that made it"),
        }
    }

    #[inline(always)]
    fn step<V: Vector>(&self, workspace: &mut AnyWorkspace<'a, V>, state: &mut [V], command: &[V]) {
        match (self, workspace) {
            (Self::Model(model), AnyWorkspace::Model(workspace)) => {
                // By a call: the step that other loops call is compiled already.
                step_apart(model, workspace, state, command);
            }
            (Self::Quadrotor(plant), AnyWorkspace::Quadrotor(workspace)) => {
                step_apart(*plant, workspace, state, command);
            }
            _ => unreachable!("a workspace belongs to the dynamics that made it"),
        }
    }

    #[inline(always)]
    fn levels(&self) -> Option<&Levels> {
        match self {
            Self::Model(model) => model.levels(),
            Self::Quadrotor(plant) => plant.levels(),
        }
    }

    #[inline(always)]
    fn in_time(&self) -> bool {
        match self {
            Self::Model(model) => model.in_time(),
            Self::Quadrotor(plant) => plant.in_time(),
        }
    }

    #[inline(always)]
    fn read<V: Vector>(&self, workspace: &mut AnyWorkspace<'a, V>, state: &[V], reading: &mut [V]) {
        match (self, workspace) {
            (Self::Model(model), AnyWorkspace::Model(workspace)) => model.read(workspace, state, reading),
            (Self::Quadrotor(plant), AnyWorkspace::Quadrotor(workspace)) => {
                plant.read(workspace, state, reading);
            }
            _ => unreachable!("a workspace belongs to the dynamics that made it"),
        }
    }

    #[inline(always)]
    fn state_of<V: Vector>(&self, reading: &[V]) -> Vec<V> {
        match self {
            Self::Model(model) => model.state_of(reading),
            Self::Quadrotor(plant) => plant.state_of(reading),
        }
    }
}
