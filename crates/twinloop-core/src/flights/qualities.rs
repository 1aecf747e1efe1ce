//! Qualities: how well every candidate flies on every member of a committee, under every draw of noise.

use super::envelope::{Envelope, Reach};
use super::quality::{Quality, Tally};
use super::{Flights, Group};
use crate::any_dynamics::AnyDynamics;
use crate::error::{Result, invalid};
use crate::lanes::{Isa, Kernel, Vector, dispatch, splats, with_flight_lanes};
use crate::rollout::{Seen, Watch, rollout};
use crate::workers::Workers;

/// Common random numbers: each draw is the same for all candidates and members, so that they differ by what they are.
#[derive(Clone, Copy, Default)]
pub struct Draws<'a> {
    /// What the sensors add to the state, (n + 1) × n_x a draw; empty for perfect sensors.
    pub noise: &'a [&'a [f64]],
    /// What is added to the initial states, n_x a draw; empty for nothing.
    pub offsets: &'a [&'a [f64]],
    /// What is added to the true state after each step, n × n_x a draw: gusts; empty for nothing.
    pub disturbances: &'a [&'a [f64]],
    /// Whether qualities are those of the readings, as a record of a flight gives them, or of the true states.
    pub measured: bool,
}

impl Draws<'_> {
    /// Flights of each candidate on each member: one without noise where there are no draws.
    pub fn count(&self) -> usize {
        self.noise.len().max(self.offsets.len()).max(self.disturbances.len()).max(1)
    }

    fn check(&self, flights: &Flights) -> Result<()> {
        let (n, n_x) = (flights.steps(), flights.signals().states());
        let (count, noise) = (self.count(), (n + 1) * n_x);
        let fits = |rows: &[&[f64]], length: usize| {
            (rows.is_empty() || rows.len() == count)
                && rows.iter().all(|row| row.len() == length && row.iter().all(|x| x.is_finite()))
        };
        if !fits(self.noise, noise) || !fits(self.offsets, n_x) || !fits(self.disturbances, n * n_x) {
            return invalid(format!(
                "draws: expected none or {count} of noise, {noise} finite numbers each, of offsets, {n_x} each, and of \
                 disturbances, {} each, found {}, {} and {}",
                n * n_x,
                self.noise.len(),
                self.offsets.len(),
                self.disturbances.len()
            ));
        }
        Ok(())
    }
}

/// What a flight is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judged {
    /// Its quality, to be minimised; infinite if it diverged.
    pub quality: f64,
    /// The most that a true state, the first one included, used of its envelope: 1 at a bound; infinite if it diverged.
    pub usage: f64,
}

/// Every flight (members × draws × candidates, the last fastest).
pub fn qualities(
    dynamics: &[AnyDynamics<'_>],
    flights: &Flights,
    quality: &Quality,
    envelope: &Envelope,
    draws: Draws<'_>,
    workers: &Workers,
) -> Result<Vec<Judged>> {
    let n_x = flights.signals().states();
    if quality.weights.len() != n_x || envelope.states() != n_x {
        let (weights, bounds) = (quality.weights.len(), envelope.states());
        return invalid(format!(
            "qualities: expected weights and an envelope of {n_x} states, found {weights} and {bounds}"
        ));
    }
    draws.check(flights)?;
    let (groups, count) = (flights.groups.len(), draws.count());
    let judged = workers.map_flights(flights.setting.family(), dynamics.len() * count * groups, |unit| {
        let (draw, group) = (unit / groups % count, &flights.groups[unit % groups]);
        let dynamics = &dynamics[unit / groups / count];
        let row = |rows: &[&'_ [f64]]| rows.get(draw).map_or(vec![], |row| row.to_vec());
        let (noise, offset, disturbance) = (row(draws.noise), row(draws.offsets), row(draws.disturbances));
        let (noise, offset, disturbance) = (noise.as_slice(), offset.as_slice(), disturbance.as_slice());
        let measured = draws.measured;
        let of_group =
            OfGroup { dynamics, flights, group, quality, envelope, noise, offset, disturbance, measured };
        dispatch(workers.width(), of_group)
    });
    Ok(judged.concat())
}

struct OfGroup<'a> {
    dynamics: &'a AnyDynamics<'a>,
    flights: &'a Flights,
    group: &'a Group,
    quality: &'a Quality,
    envelope: &'a Envelope,
    /// (n + 1) × n_x, or empty.
    noise: &'a [f64],
    /// n_x, or empty.
    offset: &'a [f64],
    /// n × n_x, or empty.
    disturbance: &'a [f64],
    measured: bool,
}

impl Kernel for OfGroup<'_> {
    type Output = Vec<Judged>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<Judged> {
        with_flight_lanes!(W, self.group.candidates, self.lanes())
    }
}

impl OfGroup<'_> {
    #[inline(always)]
    fn lanes<V: Vector>(&self) -> Vec<Judged> {
        let mut lanes = self.group.lanes::<V>();
        for (initial, &offset) in lanes.initial.iter_mut().zip(self.offset) {
            *initial = *initial + V::splat(offset);
        }
        let (noise, disturbance) = (splats::<V>(self.noise), splats::<V>(self.disturbance));
        let mut judge = Judge {
            tally: self.quality.tally(self.flights.signals(), &lanes.target),
            reach: self.envelope.reach(&self.flights.signals().periods, &lanes.initial),
            noise: &noise,
            measured: self.measured,
            reading: lanes.initial.clone(),
        };
        let lasted = rollout(*self.dynamics, &self.flights.start(&lanes, &noise, &disturbance), &mut judge);
        let (quality, usage) = (judge.tally.total(), judge.reach.usage());
        let of_lane = |l: usize| {
            if lasted[l] < self.flights.steps {
                Judged { quality: f64::INFINITY, usage: f64::INFINITY }
            } else {
                Judged { quality: quality.lane(l), usage: usage.lane(l) }
            }
        };
        (0..self.group.candidates).map(of_lane).collect()
    }
}

/// Tallies the quality and follows the envelope.
struct Judge<'a, V> {
    tally: Tally<'a, V>,
    reach: Reach<'a, V>,
    /// Of the readings that the quality is of; empty where there is none.
    noise: &'a [V],
    measured: bool,
    reading: Vec<V>,
}

impl<V: Vector> Watch<V> for Judge<'_, V> {
    #[inline(always)]
    fn see(&mut self, seen: Seen<'_, V>) {
        self.reach.see(seen.next);
        if !self.measured || self.noise.is_empty() {
            let shown = if self.measured { seen.read } else { seen.next };
            return self.tally.add(seen.step, seen.command, shown);
        }
        let after = self.noise.chunks_exact(seen.read.len()).nth(seen.step + 1);
        let readings = self.reading.iter_mut().zip(seen.read).zip(after.unwrap_or_default());
        for ((reading, &read), &noise) in readings {
            *reading = read + noise;
        }
        self.tally.add(seen.step, seen.command, &self.reading);
    }
}
