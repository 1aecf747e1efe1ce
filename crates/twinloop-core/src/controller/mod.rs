//! Controllers: families with a bounded parameter vector, one implementation for the search and for the real run.

mod family;
mod foreign;
mod mixer;
mod parameters;
mod pid;
mod single;
mod state_feedback;

pub use family::{Controllers, Family};
pub use foreign::{ForeignController, ForeignLaw};
pub use mixer::Mixer;
pub use parameters::{Gain, Parameters};
pub use pid::{Axis, Outer, Pid};
pub use single::Controller;
pub use state_feedback::StateFeedback;

use crate::difference::Periods;
use crate::error::Result;
use crate::lanes::Vector;

/// A control law. Gains, memory and signals are lanes: several controllers of the family at once.
pub trait Law {
    /// Number of its gains.
    fn gains(&self) -> usize;

    /// Lanes of memory that a controller carries from step to step, zero at the start of a run.
    fn memory(&self) -> usize;

    /// From what it asks for to commands.
    fn output(&self) -> &Mixer;

    /// Refuses a law that reads states which are not there.
    fn check(&self, states: usize) -> Result<()>;

    /// Writes the command (n_u) for a state (n_x) and a target (n_x), and moves the memory on by one period. Errors are
    /// differences as `periods` has them.
    fn command<V: Vector>(
        &self,
        periods: &Periods,
        gains: &[V],
        memory: &mut [V],
        state: &[V],
        target: &[V],
        command: &mut [V],
    );
}

/// One type for all laws there are.
macro_rules! laws {
    ($($law:ident),+) => {
        /// Any of the laws.
        #[derive(Clone, Debug, PartialEq)]
        pub enum AnyLaw {
            $(
                #[doc = concat!("A [`", stringify!($law), "`].")]
                $law($law),
            )+
        }

        $(
            impl From<$law> for AnyLaw {
                fn from(law: $law) -> Self {
                    Self::$law(law)
                }
            }
        )+

        impl AnyLaw {
            /// Period of the commands, s.
            fn dt(&self) -> f64 {
                match self { $(Self::$law(law) => law.dt,)+ }
            }
        }

        impl Law for AnyLaw {
            fn gains(&self) -> usize {
                match self { $(Self::$law(law) => law.gains(),)+ }
            }

            fn memory(&self) -> usize {
                match self { $(Self::$law(law) => law.memory(),)+ }
            }

            fn output(&self) -> &Mixer {
                match self { $(Self::$law(law) => law.output(),)+ }
            }

            fn check(&self, states: usize) -> Result<()> {
                match self { $(Self::$law(law) => law.check(states),)+ }
            }

            #[inline(always)]
            fn command<V: Vector>(
                &self,
                periods: &Periods,
                gains: &[V],
                memory: &mut [V],
                state: &[V],
                target: &[V],
                command: &mut [V],
            ) {
                match self {
                    $(Self::$law(law) => law.command(periods, gains, memory, state, target, command),)+
                }
            }
        }
    };
}

// A new law is a file here, and its name in this list.
laws!(Pid, StateFeedback);
