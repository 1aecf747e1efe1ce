//! Sensors that are late or early: what they read of the course of a run, by the kinematics of the states alone.
//!
//! A late sensor reads what was a while ago: between two states of the run it follows the cubic through both and through
//! their rates, an attitude as a quaternion (Hairer, Nørsett, Wanner 1993, section II.6). An early one reads what will
//! be, as far as rates tell that go on as they did over the last period. Before a run nothing changed but by its rates.
//! What is given of readings (`reports`) may be something else again.

use std::collections::VecDeque;

use crate::attitude::{angles, quaternion, turning};
use crate::error::{Result, invalid};
use crate::lanes::{Scalar, Vector};
use crate::reports::{Memory, Reports};
use crate::signals::{RigidBody, Signals};

/// By how much later than others each state is read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sensors {
    /// Of each state, s; empty where all are in time.
    offsets: Vec<f64>,
    /// Offsets other than 0 in periods, each with its states.
    groups: Vec<(f64, Vec<usize>)>,
    dt: f64,
    /// The state that is the derivative of each one, where there is one.
    rates: Vec<Option<usize>>,
    /// Whether nothing but a model moves the state.
    driven: Vec<bool>,
    body: Option<RigidBody>,
    reports: Reports,
}

impl Sensors {
    /// Offsets of more periods than this are refused.
    pub const FARTHEST: f64 = 1000.0;

    /// Those of a system, later by so many s each (n_x): only of states that others give, for these alone say what
    /// stood between two readings.
    pub fn new(offsets: &[f64], signals: &Signals) -> Result<Self> {
        let (states, dt) = (signals.states(), signals.dt);
        let fits = |(state, &offset): (usize, &f64)| {
            offset == 0.0 || (signals.is_given(state) && offset.abs() <= Self::FARTHEST * dt)
        };
        if offsets.len() != states || !offsets.iter().enumerate().all(fits) {
            return invalid(format!(
                "offsets: expected one for each of {states} states, 0 s for those that no other states give and at \
                 most {} periods for the others, found {offsets:?}",
                Self::FARTHEST
            ));
        }
        let mut groups: Vec<(f64, Vec<usize>)> = vec![];
        for (state, periods) in offsets.iter().map(|offset| offset / dt).enumerate() {
            match groups.iter_mut().find(|(known, _)| *known == periods) {
                _ if periods == 0.0 => {}
                Some((_, members)) => members.push(state),
                None => groups.push((periods, vec![state])),
            }
        }
        let rate = |state| signals.derivative_of.iter().position(|&of| of == Some(state));
        Ok(Self {
            offsets: if groups.is_empty() { vec![] } else { offsets.to_vec() },
            groups,
            dt,
            rates: (0..states).map(rate).collect(),
            driven: (0..states).map(|state| !signals.is_given(state)).collect(),
            body: signals.kinematics,
            reports: Reports::default(),
        })
    }

    /// The same, of whose readings so much is given.
    pub fn with_reports(self, reports: Reports) -> Self {
        Self { reports, ..self }
    }

    /// What is given of their readings.
    pub fn reports(&self) -> &Reports {
        &self.reports
    }

    /// Whether every state is read, and given, as it is.
    #[inline(always)]
    pub fn in_time(&self) -> bool {
        self.groups.is_empty() && self.reports.is_none()
    }

    /// Of each state, s; empty where all are in time.
    pub fn offsets(&self) -> &[f64] {
        &self.offsets
    }

    /// Puts what is given of readings (n_x) at a state that a run has come to. To be called at each state in turn.
    pub(crate) fn read<V: Vector>(&self, recent: &mut Recent, state: &[V], reading: &mut [V]) {
        reading.copy_from_slice(state);
        recent.lanes.resize_with(V::LANES, Lane::default);
        for (l, lane) in recent.lanes.iter_mut().enumerate() {
            let state: Vec<Scalar> = state.iter().map(|value| Scalar::splat(value.lane(l))).collect();
            let mut given = state.clone();
            let late = self.read_lane(lane, state);
            for &(i, found) in &late {
                given[i] = found;
            }
            self.reports.give(&mut lane.given, &mut given);
            let others = self.reports.each().iter().map(|&(i, _)| i);
            for i in late.iter().map(|&(i, _)| i).chain(others) {
                set_lane(&mut reading[i], l, given[i].lane(0));
            }
        }
    }

    /// The late and early readings of one run at its present state, by the number of the state.
    fn read_lane(&self, lane: &mut Lane, state: Vec<Scalar>) -> Vec<(usize, Scalar)> {
        lane.keep(state, self.reach());
        let now = lane.seen - 1;
        let mut read = vec![];
        for (periods, states) in &self.groups {
            let at = now as f64 - periods;
            let found = if at < 0.0 {
                self.extrapolated(&lane.states[0], None, at * self.dt)
            } else if at > now as f64 {
                self.extrapolated(&lane.states[lane.states.len() - 1], lane.back(1), -periods * self.dt)
            } else {
                let back = libm::ceil(*periods) as usize;
                let share = back as f64 - periods;
                match (lane.back(back), lane.back(back - 1)) {
                    (Some(before), Some(after)) if share > 0.0 => self.between(before, after, share),
                    (Some(there), _) => there.to_vec(),
                    (None, _) => unreachable!("all states that sensors need are stored"),
                }
            };
            read.extend(states.iter().map(|&state| (state, found[state])));
        }
        read
    }

    /// The state (n_x) whose reading this is, at the start of a run.
    pub(crate) fn state_of<V: Vector>(&self, reading: &[V]) -> Vec<V> {
        let mut found = reading.to_vec();
        for l in 0..V::LANES {
            let of: Vec<Scalar> = reading.iter().map(|value| Scalar::splat(value.lane(l))).collect();
            for (found, state) in found.iter_mut().zip(self.state_of_lane(of)) {
                set_lane(found, l, state.lane(0));
            }
        }
        found
    }

    /// The same of one run.
    fn state_of_lane(&self, reading: Vec<Scalar>) -> Vec<Scalar> {
        let mut found = reading;
        // Rates first: what they are rates of is moved along them.
        let order = |state: usize| std::iter::successors(self.rates[state], |&rate| self.rates[rate]).count();
        let longest = (0..found.len()).map(order).max().unwrap_or(0);
        for depth in 0..=longest {
            for (periods, states) in &self.groups {
                let moved = self.extrapolated(&found, None, periods * self.dt);
                for &state in states.iter().filter(|&&state| order(state) == depth) {
                    found[state] = moved[state];
                }
            }
        }
        found
    }

    /// Number of earlier states that sensors need.
    fn reach(&self) -> usize {
        self.groups.iter().fold(1, |most, (periods, _)| most.max(libm::ceil(*periods) as usize))
    }

    /// A state (n_x) extrapolated by `time` (s; below 0: back) with kinematics alone. Driven states change as they did
    /// from the state one period `before`, or stay.
    fn extrapolated(&self, state: &[Scalar], before: Option<&[Scalar]>, time: f64) -> Vec<Scalar> {
        let mut rates = state.to_vec();
        if let Some(before) = before {
            // Their mean over the time.
            for (i, rate) in rates.iter_mut().enumerate().filter(|(i, _)| self.driven[*i]) {
                *rate = *rate + (state[i] - before[i]) * (0.5 * time / self.dt);
            }
        }
        let mut found = state.to_vec();
        for (i, found) in found.iter_mut().enumerate() {
            let (mut next, mut factor) = (self.rates[i], 1.0);
            let mut order = 1.0;
            while let Some(rate) = next {
                factor *= time / order;
                *found = *found + rates[rate] * factor;
                (next, order) = (self.rates[rate], order + 1.0);
            }
        }
        if let Some(body) = &self.body {
            let before = body.angles.map(|angle| state[angle]);
            let turned = turned(quaternion(before), body.rates.map(|rate| rates[rate]), time);
            put(&mut found, body, turned, before);
        }
        found
    }

    /// What lies between two states of a run a period apart, at a share of it.
    fn between(&self, before: &[Scalar], after: &[Scalar], share: f64) -> Vec<Scalar> {
        let cubic = Cubic::at(share, self.dt);
        let mut found = after.to_vec();
        for (i, found) in found.iter_mut().enumerate() {
            if let Some(rate) = self.rates[i] {
                *found = cubic.of(before[i], before[rate], after[i], after[rate]);
            }
        }
        if let Some(body) = &self.body {
            let from = body.angles.map(|angle| before[angle]);
            let begun = quaternion(from);
            let ended = quaternion(body.angles.map(|angle| after[angle]));
            // A quaternion and its negative are the same attitude.
            let along = (0..4).fold(Scalar::splat(0.0), |sum, i| sum + begun[i] * ended[i]);
            let sign = along.select_less(Scalar::splat(0.0), Scalar::splat(-1.0), Scalar::splat(1.0));
            let ended = ended.map(|part| part * sign);
            let first = turning(begun, body.rates.map(|rate| before[rate]));
            let last = turning(ended, body.rates.map(|rate| after[rate]));
            let attitude = std::array::from_fn(|i| cubic.of(begun[i], first[i], ended[i], last[i]));
            put(&mut found, body, attitude, from);
        }
        found
    }
}

/// What of each lane's run is kept for its sensors. Late sensors are rare, and each lane is read by itself: that is one
/// copy of the code, where there would be one for each width.
#[derive(Clone, Default)]
pub(crate) struct Recent {
    lanes: Vec<Lane>,
}

/// The last states of a run, the newest at the end, and how many there were.
#[derive(Clone, Default)]
struct Lane {
    states: VecDeque<Vec<Scalar>>,
    seen: usize,
    given: Memory,
}

impl Lane {
    fn keep(&mut self, state: Vec<Scalar>, reach: usize) {
        if self.states.len() > reach {
            self.states.pop_front();
        }
        self.states.push_back(state);
        self.seen += 1;
    }

    /// The state some periods before the newest.
    fn back(&self, periods: usize) -> Option<&[Scalar]> {
        let place = self.states.len().checked_sub(periods + 1)?;
        Some(&self.states[place])
    }
}

fn set_lane<V: Vector>(vector: &mut V, l: usize, value: f64) {
    let mut values = vec![0.0; V::LANES];
    vector.store(&mut values);
    values[l] = value;
    *vector = V::load(&values);
}

/// Weights of Hermite's cubic through two values and their derivatives.
struct Cubic {
    values: [f64; 2],
    slopes: [f64; 2],
}

impl Cubic {
    /// At a share of a step.
    fn at(share: f64, step: f64) -> Self {
        let rest = 1.0 - share;
        Self {
            values: [rest * rest * (1.0 + 2.0 * share), share * share * (3.0 - 2.0 * share)],
            slopes: [step * share * rest * rest, -step * share * share * rest],
        }
    }

    fn of(&self, before: Scalar, begun: Scalar, after: Scalar, ended: Scalar) -> Scalar {
        before * self.values[0] + after * self.values[1] + begun * self.slopes[0] + ended * self.slopes[1]
    }
}

/// A quaternion after some time of turning at body rates that stay.
fn turned(attitude: [Scalar; 4], rates: [Scalar; 3], time: f64) -> [Scalar; 4] {
    let [p, q, r] = rates;
    let half = (p * p + q * q + r * r).sqrt() * (0.5 * time);
    let (cosine, sine) = (half.map(libm::cos), half.map(|x| if x == 0.0 { 1.0 } else { libm::sin(x) / x }));
    let slope = turning(attitude, rates);
    std::array::from_fn(|i| attitude[i] * cosine + slope[i] * sine * time)
}

/// Writes the angles of an attitude, by whole turns the nearest to what they were.
fn put(state: &mut [Scalar], body: &RigidBody, attitude: [Scalar; 4], before: [Scalar; 3]) {
    for (&at, angle) in body.angles.iter().zip(angles(attitude, before)) {
        state[at] = angle;
    }
}
