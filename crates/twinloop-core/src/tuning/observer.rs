//! The observer: what runs leave of a model's predictions, for many variants side by side.

use super::variant::Variant;
use super::{Observed, Recorded, Tuning};
use crate::any_dynamics::AnyWorkspace;
use crate::difference::Periods;
use crate::lanes::{Isa, Kernel, Vector, dispatch, pack, with_flight_lanes};
use crate::model::Model;
use crate::regression::{LONGEST, Record, Whitening};
use crate::rollout::{Commands, Midway, Seen, Start, Watch, resumed};
use crate::workers::Workers;

/// What an observer makes of a record of n + 1 readings, row by row.
pub struct Predictions {
    /// Whitened prediction errors, (n + 1) × n_x.
    pub errors: Vec<f64>,
    /// States once each reading was used, (n + 1) × n_x.
    pub states: Vec<f64>,
    /// Correlated disturbances at that time, one a chain; 0 of a chain that has none.
    pub gusts: Vec<f64>,
}

/// Variants that run side by side.
pub(super) const LANES: usize = 32;

impl Tuning<'_> {
    /// What the observer of the model as it is makes of each record; none where it diverges.
    pub fn predictions(&self, workers: &Workers) -> Option<Vec<Predictions>> {
        let whitenings = self.whitenings();
        let variant = self.start();
        let runs = workers.map(self.records.len(), |r| {
            let part = Part {
                tuning: self,
                record: r,
                whitenings: &whitenings[r],
                variants: std::slice::from_ref(&variant),
                keep: true,
            };
            dispatch(workers.width(), part)
        });
        let finite = runs.iter().all(|run| !run.diverged[0]);
        let of_states = |run: Run| Predictions {
            errors: self.by_state(&run.errors[0]),
            states: run.states,
            gusts: run.gusts,
        };
        finite.then(|| runs.into_iter().map(of_states).collect())
    }

    /// Rows of n_x numbers from the order of the chains to that of the states.
    fn by_state(&self, by_chain: &[f64]) -> Vec<f64> {
        let order: Vec<usize> = self.observer.iter().flat_map(|observed| observed.states.clone()).collect();
        let mut sorted = vec![0.0; by_chain.len()];
        for (sorted, row) in sorted.chunks_exact_mut(order.len()).zip(by_chain.chunks_exact(order.len())) {
            order.iter().zip(row).for_each(|(&state, &number)| sorted[state] = number);
        }
        sorted
    }

    /// The filters of each record, one a chain.
    pub(super) fn whitenings(&self) -> Vec<Vec<Whitening>> {
        let states = self.limits.signals().states();
        let of_chain = |record: &Recorded, observed: &Observed| {
            let pick = |values: &[f64]| -> Vec<f64> {
                values.chunks_exact(states).flat_map(|row| observed.states.iter().map(|&i| row[i])).collect()
            };
            let chain =
                Record { measured: pick(&record.states), weights: pick(&record.weights), increments: vec![] };
            let spread = chain.spread(&observed.chain);
            Whitening::new(&observed.chain, &observed.noise, &chain.weights, &spread)
        };
        self.records
            .iter()
            .map(|record| self.observer.iter().map(|observed| of_chain(record, observed)).collect())
            .collect()
    }

    /// χ² of each variant.
    pub(super) fn costs(
        &self,
        whitenings: &[Vec<Whitening>],
        variants: &[Variant],
        workers: &Workers,
    ) -> Vec<f64> {
        let runs = workers.map(self.records.len(), |r| {
            let part = Part { tuning: self, record: r, whitenings: &whitenings[r], variants, keep: false };
            dispatch(workers.width(), part)
        });
        (0..variants.len())
            .map(|v| {
                let of_run = |run: &Run| if run.diverged[v] { f64::INFINITY } else { run.squares[v] };
                runs.iter().map(of_run).sum()
            })
            .collect()
    }
}

/// Variants of a model on one record.
pub(super) struct Part<'a> {
    pub tuning: &'a Tuning<'a>,
    pub record: usize,
    pub whitenings: &'a [Whitening],
    pub variants: &'a [Variant],
    /// Whether errors and states are kept.
    pub keep: bool,
}

/// What a record makes of variants.
#[derive(Default)]
pub(super) struct Run {
    /// χ² of each.
    pub squares: Vec<f64>,
    pub diverged: Vec<bool>,
    /// Whitened prediction errors of each, if they were to be kept.
    pub errors: Vec<Vec<f64>>,
    /// States of the first variant after each reading was used.
    pub states: Vec<f64>,
    /// Its correlated disturbances at that time, one a chain.
    pub gusts: Vec<f64>,
}

impl Kernel for Part<'_> {
    type Output = Run;

    #[inline(always)]
    fn run<W: Isa>(self) -> Run {
        let mut all = Run::default();
        for variants in self.variants.chunks(LANES) {
            let part = Part { variants, ..self };
            let run = with_flight_lanes!(W, variants.len(), part.lanes());
            all.squares.extend(run.squares);
            all.diverged.extend(run.diverged);
            all.errors.extend(run.errors);
            if all.states.is_empty() {
                all.states = run.states;
                all.gusts = run.gusts;
            }
        }
        all
    }
}

impl Part<'_> {
    #[inline(always)]
    fn lanes<V: Vector>(&self) -> Run {
        let Tuning { code, frame, observer, records, limits, .. } = *self.tuning;
        let record = &records[self.record];
        let count = self.variants.len();
        let constants: Vec<&[f64]> = self.variants.iter().map(|variant| &variant.constants[..]).collect();
        let lags: Vec<&[f64]> = self.variants.iter().map(|variant| &variant.lags[..]).collect();
        let model = Model { code, frame };
        let workspace = AnyWorkspace::Model(model.variants::<V>(&pack(&constants), &pack(&lags)));
        let start = Start {
            commands: Commands::Record(&record.commands),
            initial: &pack(&[&record.states[..limits.signals().states()]]),
            steps: record.commands.len() / frame.commands(),
            limits: limits.magnitudes(),
            noise: &[],
            disturbance: &[],
        };
        let room = if self.keep { record.states.len() } else { 0 };
        let mut filters = Filters {
            observer,
            record,
            whitenings: self.whitenings,
            periods: frame.periods(),
            keep: self.keep,
            gusts: vec![V::splat(0.0); observer.len()],
            squares: V::splat(0.0),
            run: Run {
                errors: vec![Vec::with_capacity(room); count],
                states: Vec::with_capacity(room),
                ..Run::default()
            },
        };
        let midway = Midway { workspace, controllers: None };
        let lasted = resumed(model.into(), midway, &start, &mut filters);
        let Filters { squares, run, .. } = filters;
        Run {
            squares: (0..count).map(|lane| squares.lane(lane)).collect(),
            diverged: (0..count)
                .map(|lane| lasted[lane] < start.steps || !squares.lane(lane).is_finite())
                .collect(),
            ..run
        }
    }
}

/// Filters, one a chain, that correct a model's states by each reading of a record.
struct Filters<'a, V> {
    observer: &'a [Observed],
    record: &'a Recorded,
    whitenings: &'a [Whitening],
    periods: &'a Periods,
    keep: bool,
    /// Correlated disturbances, one a chain.
    gusts: Vec<V>,
    /// χ² of each lane.
    squares: V,
    run: Run,
}

impl<V: Vector> Watch<V> for Filters<'_, V> {
    #[inline(always)]
    fn correct(&mut self, at: usize, state: &mut [V]) {
        if at > 0 {
            self.disturb(state);
        }
        let (mut innovation, mut white) = ([V::splat(0.0); LONGEST], [V::splat(0.0); LONGEST]);
        let mut correction = [V::splat(0.0); LONGEST + 1];
        let read = &self.record.states[at * state.len()..];
        for ((observed, whitening), gust) in self.observer.iter().zip(self.whitenings).zip(&mut self.gusts) {
            let d = observed.states.len();
            for (innovation, &i) in innovation.iter_mut().zip(&observed.states) {
                *innovation = self.periods.difference(i, V::splat(read[i]), state[i]);
            }
            let inner = &mut correction[..whitening.inner];
            whitening.reading(at, d).observe(&innovation[..d], &mut white, inner);
            for ((&i, &white), &by) in observed.states.iter().zip(&white).zip(&correction) {
                self.squares = self.squares + white * white;
                state[i] = state[i] + by;
                if self.keep {
                    for (lane, errors) in self.run.errors.iter_mut().enumerate() {
                        errors.push(white.lane(lane));
                    }
                }
            }
            if whitening.inner > d {
                *gust = *gust + correction[d];
            }
        }
        if self.keep {
            self.run.states.extend(state.iter().map(|value| value.lane(0)));
            self.run.gusts.extend(self.gusts.iter().map(|gust| gust.lane(0)));
        }
    }

    #[inline(always)]
    fn see(&mut self, _seen: Seen<'_, V>) {}
}

impl<V: Vector> Filters<'_, V> {
    /// Moves the states on by what disturbed them in the period before, and the disturbances themselves.
    #[inline(always)]
    fn disturb(&mut self, state: &mut [V]) {
        for ((observed, whitening), gust) in self.observer.iter().zip(self.whitenings).zip(&mut self.gusts) {
            if whitening.inner > observed.states.len() {
                for (&i, reach) in observed.states.iter().zip(observed.chain.motion().reach) {
                    state[i] = state[i] + *gust * reach;
                }
                *gust = *gust * whitening.correlation;
            }
        }
    }
}
