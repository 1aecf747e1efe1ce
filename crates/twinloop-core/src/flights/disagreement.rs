//! Disagreement: how far apart the members of a committee predict a flight, as the information that it would give.

use super::{Flights, Group};
use crate::difference::Periods;
use crate::error::{Result, invalid};
use crate::lanes::{Isa, Kernel, Vector, dispatch, with_flight_lanes};
use crate::linear_algebra::{log_determinant, place};
use crate::model::Model;
use crate::rollout::{Seen, Watch, rollout};
use crate::workers::Workers;

/// How much the members disagree on a flight, and where most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disagreement {
    /// log det(I + D Dᵀ), 0 where all members agree, to be maximised. Row m of D is member m's noise-free trajectory
    /// minus the members' mean, each entry divided by the sd of its state and winsorised. It is summed over all steps
    /// and states and not divided by their number: if readings carry independent noise of these sds, it grows with
    /// what the flight tells about which member is right.
    pub value: f64,
    /// Row of the states, 1 to n, where two members are the most sds apart; 0 where no two ever differ.
    pub step: usize,
    /// The state there.
    pub state: usize,
    /// The member that predicts the largest value there.
    pub highest: usize,
    /// The member that predicts the smallest.
    pub lowest: usize,
}

/// Groups whose trajectories are kept at a time: enough for many threads, and a bound on the memory.
const BATCH: usize = 4;

/// Disagreement on each candidate. A member that diverges stays, from then on, where it last was within the limits.
pub fn disagreements(
    members: &[Model<'_>],
    flights: &Flights,
    sds: &[f64],
    cap: f64,
    workers: &Workers,
) -> Result<Vec<Disagreement>> {
    let positive = |x: f64| x.is_finite() && x > 0.0;
    if members.is_empty() || sds.len() != flights.signals().states() {
        return invalid(format!(
            "disagreements: expected at least one member and {} sds, one for each state, found {} and {}",
            flights.signals().states(),
            members.len(),
            sds.len()
        ));
    }
    if !sds.iter().all(|&sd| positive(sd)) || !positive(cap) {
        return invalid(format!("disagreements: expected sds and a cap above 0, found {sds:?} and {cap}"));
    }
    let mut found = Vec::with_capacity(flights.len());
    for batch in flights.groups.chunks(BATCH) {
        let runs = workers.map_flights(flights.setting.family(), batch.len() * members.len(), |unit| {
            let (group, member) = (&batch[unit / members.len()], &members[unit % members.len()]);
            dispatch(workers.width(), Fly { member, flights, group })
        });
        let compared = workers.map(batch.len(), |i| {
            let runs = &runs[i * members.len()..][..members.len()];
            let periods = &flights.signals().periods;
            dispatch(workers.width(), Compare { runs, candidates: batch[i].candidates, periods, sds, cap })
        });
        found.extend(compared.into_iter().flatten());
    }
    Ok(found)
}

/// What is read of a group on one member but for noise, n × n_x × lanes.
struct Fly<'a> {
    member: &'a Model<'a>,
    flights: &'a Flights,
    group: &'a Group,
}

impl Kernel for Fly<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<f64> {
        with_flight_lanes!(W, self.group.candidates, self.lanes())
    }
}

impl Fly<'_> {
    #[inline(always)]
    fn lanes<V: Vector>(&self) -> Vec<f64> {
        let lanes = self.group.lanes::<V>();
        let (steps, row) = (self.flights.steps, lanes.initial.len() * V::LANES);
        let mut states = States(vec![0.0; steps * row]);
        let lasted = rollout((*self.member).into(), &self.flights.start(&lanes, &[], &[]), &mut states);
        let States(mut states) = states;
        for (l, &lasted) in lasted.iter().enumerate() {
            for step in lasted..steps {
                for place in (l..row).step_by(V::LANES) {
                    states[step * row + place] =
                        if step == 0 { self.group.initial[place] } else { states[(step - 1) * row + place] };
                }
            }
        }
        states
    }
}

/// Keeps what is read of every state after the first, n × n_x × lanes.
struct States(Vec<f64>);

impl<V: Vector> Watch<V> for States {
    #[inline(always)]
    fn see(&mut self, seen: Seen<'_, V>) {
        let row = seen.read.len() * V::LANES;
        let kept = self.0[seen.step * row..][..row].chunks_exact_mut(V::LANES);
        for (kept, state) in kept.zip(seen.read) {
            state.store(kept);
        }
    }
}

/// The disagreement of the members on a group of candidates.
struct Compare<'a> {
    /// What each member predicts, n × n_x × lanes.
    runs: &'a [Vec<f64>],
    candidates: usize,
    periods: &'a Periods,
    sds: &'a [f64],
    cap: f64,
}

impl Kernel for Compare<'_> {
    type Output = Vec<Disagreement>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<Disagreement> {
        with_flight_lanes!(W, self.candidates, self.lanes())
    }
}

impl Compare<'_> {
    #[inline(always)]
    fn lanes<V: Vector>(&self) -> Vec<Disagreement> {
        let (members, n_x) = (self.runs.len(), self.sds.len());
        let mut gram = vec![V::splat(0.0); place(members, 0)];
        let mut values = vec![V::splat(0.0); members];
        let mut widest = Widest::new();
        for entry in 0..self.runs[0].len() / V::LANES {
            let (step, state) = (entry / n_x + 1, entry % n_x);
            let mut sum = V::splat(0.0);
            for (value, run) in values.iter_mut().zip(self.runs) {
                let mut predicted = V::load(&run[entry * V::LANES..]);
                if self.periods.of(state).is_some() {
                    // Whole turns between two members tell nothing.
                    let first = V::load(&self.runs[0][entry * V::LANES..]);
                    predicted = first + self.periods.difference(state, predicted, first);
                }
                *value = predicted / self.sds[state];
                sum = sum + *value;
            }
            widest.see(step, state, &values);
            let mean = sum / members as f64;
            for value in &mut values {
                *value = (*value - mean).clamp(-self.cap, self.cap);
            }
            for a in 0..members {
                for b in 0..=a {
                    gram[place(a, b)] = gram[place(a, b)] + values[a] * values[b];
                }
            }
        }
        let value = log_determinant(&mut gram, members);
        let of_lane = |l: usize| widest.disagreement(l, value.lane(l));
        (0..self.candidates).map(of_lane).collect()
    }
}

/// Where members are the furthest apart: whole numbers in lanes.
struct Widest<V> {
    gap: V,
    step: V,
    state: V,
    highest: V,
    lowest: V,
}

impl<V: Vector> Widest<V> {
    #[inline(always)]
    fn new() -> Self {
        let zero = V::splat(0.0);
        Self { gap: zero, step: zero, state: zero, highest: zero, lowest: zero }
    }

    /// Looks at what the members predict of one state, in sds.
    #[inline(always)]
    fn see(&mut self, step: usize, state: usize, values: &[V]) {
        let (mut high, mut low) = (values[0], values[0]);
        let (mut highest, mut lowest) = (V::splat(0.0), V::splat(0.0));
        for (member, &value) in values.iter().enumerate() {
            highest = high.select_less(value, V::splat(member as f64), highest);
            lowest = value.select_less(low, V::splat(member as f64), lowest);
            high = high.select_less(value, value, high);
            low = value.select_less(low, value, low);
        }
        let gap = high - low;
        self.step = self.gap.select_less(gap, V::splat(step as f64), self.step);
        self.state = self.gap.select_less(gap, V::splat(state as f64), self.state);
        self.highest = self.gap.select_less(gap, highest, self.highest);
        self.lowest = self.gap.select_less(gap, lowest, self.lowest);
        self.gap = self.gap.select_less(gap, gap, self.gap);
    }

    fn disagreement(&self, lane: usize, value: f64) -> Disagreement {
        let whole = |number: V| number.lane(lane) as usize;
        Disagreement {
            value,
            step: whole(self.step),
            state: whole(self.state),
            highest: whole(self.highest),
            lowest: whole(self.lowest),
        }
    }
}
