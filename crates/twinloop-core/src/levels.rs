//! Levels: commands that a machine sends in a few values only, as a relay or an on-off valve does.

use crate::error::{Result, invalid};
use crate::lanes::Vector;

/// The values in which each command is sent, rising; none of a command that is sent as it is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Levels(Vec<Vec<f64>>);

impl Levels {
    /// More values of a command than this are refused.
    pub const MOST: usize = 256;

    /// Those of so many commands.
    pub fn new(levels: Vec<Vec<f64>>, commands: usize) -> Result<Self> {
        let rising = |values: &Vec<f64>| {
            let finite = values.len() <= Self::MOST && values.iter().all(|value| value.is_finite());
            finite && values.len() != 1 && values.is_sorted_by(|a, b| a < b)
        };
        if levels.len() != commands || !levels.iter().all(rising) {
            return invalid(format!(
                "levels: expected for each of {commands} commands none, or 2 to {} finite ones that rise, found {levels:?}",
                Self::MOST
            ));
        }
        let none = levels.iter().all(Vec::is_empty);
        Ok(Self(if none { vec![] } else { levels }))
    }

    /// Whether every command is sent as it is.
    #[inline(always)]
    pub fn is_none(&self) -> bool {
        self.0.is_empty()
    }

    /// Of each command; empty where every command is sent as it is.
    pub fn each(&self) -> &[Vec<f64>] {
        &self.0
    }

    /// Puts the nearest level in the place of each command (n_u lanes), half-way between two of them the lower one.
    pub(crate) fn send<V: Vector>(&self, commands: &mut [V]) {
        for (values, command) in self.0.iter().zip(commands) {
            let Some(&first) = values.first() else { continue };
            let wanted = *command;
            *command = V::splat(first);
            for pair in values.windows(2) {
                let between = V::splat(0.5 * (pair[0] + pair[1]));
                *command = between.select_less(wanted, V::splat(pair[1]), *command);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Scalar;

    #[test]
    fn the_nearest_level_is_sent() {
        let levels = Levels::new(vec![vec![-2.0, 0.0, 1.0]], 1).unwrap();
        let sent = [-9.0, -1.1, -1.0, -0.9, 0.4, 0.5, 0.6, 3.0].map(|command| {
            let mut row = [Scalar::splat(command)];
            levels.send(&mut row);
            row[0].lane(0)
        });
        assert_eq!(sent, [-2.0, -2.0, -2.0, 0.0, 0.0, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn a_command_without_levels_is_sent_as_it_is() {
        assert!(Levels::new(vec![vec![]], 1).unwrap().is_none());
        let mut row = [0.3, 0.7].map(Scalar::splat);
        Levels::new(vec![vec![], vec![0.0, 1.0]], 2).unwrap().send(&mut row);
        assert_eq!(row.map(|value| value.lane(0)), [0.3, 1.0]);
    }

    #[test]
    fn levels_that_are_none_are_refused() {
        let many = (0..=Levels::MOST).map(|k| k as f64).collect();
        let wrong =
            [vec![1.0], vec![1.0, 0.0], vec![0.0, 0.0], vec![0.0, f64::INFINITY], vec![f64::NAN, 1.0], many];
        assert!(wrong.into_iter().all(|values| Levels::new(vec![values], 1).is_err()));
        assert!(Levels::new(vec![vec![]], 2).is_err());
    }
}
