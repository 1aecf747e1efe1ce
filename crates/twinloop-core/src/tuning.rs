//! Tuning: moves a model's constants, and the times of its actuation, until its predictions leave white noise only.
//!
//! A prediction-error method with an observer of fixed gains (Ljung 1999, chapter 7). With little process noise the
//! gains fade and it is an output-error fit over whole runs; with much of it they stay and it is one of single steps.
//! The variants of a model that finite differences need are lanes of one run.

use crate::dynamics::step_apart;
use crate::error::{Result, invalid};
use crate::lanes::{Isa, Kernel, Vector, dispatch, pack, with_test_lanes};
use crate::lgp::Code;
use crate::linear_algebra::Cholesky;
use crate::model::{Frame, Model};
use crate::regression::{Chain, Noise, Record, Whitening};
use crate::rng::Stream;
use crate::setting::Limits;
use crate::workers::Workers;

/// One chain of states with the noise of its sensors and of its motion.
#[derive(Clone, Debug)]
pub struct Observed {
    /// The states, the driven one first, then its integral, and so on.
    pub states: Vec<usize>,
    /// How they move on where nothing is known.
    pub chain: Chain,
    /// Variances.
    pub noise: Noise,
}

/// What was recorded of one run.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// Readings (n + 1) × n_x.
    pub states: Vec<f64>,
    /// 1 for a reading that counts, 0 for one to be ignored, (n + 1) × n_x.
    pub weights: Vec<f64>,
    /// Commands n × n_u.
    pub commands: Vec<f64>,
}

/// What is tuned, and on what.
pub struct Tuning<'a> {
    /// The program.
    pub code: &'a Code,
    /// What makes it dynamics.
    pub frame: &'a Frame,
    /// Every state belongs to one of them.
    pub observer: &'a [Observed],
    /// The runs.
    pub records: &'a [Recorded],
    /// Within which a variant has not diverged.
    pub limits: &'a Limits,
    /// Constants of the code that may move.
    pub free: &'a [usize],
    /// Groups of lags, and of times of hidden states, that are one number which may move: commands by number, then
    /// hidden states.
    pub lags: &'a [Vec<usize>],
}

/// A tuned model.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// All constants of the code.
    pub constants: Vec<f64>,
    /// Lag of every command, then time of every hidden state, s.
    pub lags: Vec<f64>,
    /// Sum of squares of the whitened prediction errors, χ²; infinite if the model diverges on the runs.
    pub left: f64,
    /// Readings that counted.
    pub readings: usize,
    /// Covariance of the free constants, then of the free lags, each known to its own size beforehand; empty if it
    /// could not be had.
    pub covariance: Vec<f64>,
}

/// Constants and lags of one variant.
#[derive(Clone, Debug)]
struct Variant {
    constants: Vec<f64>,
    lags: Vec<f64>,
}

/// Relative step of a finite difference.
const STEP: f64 = 1e-6;
/// Dampings that are tried at once, as multiples of the last that worked.
const DAMPINGS: [f64; 8] = [1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e6];
/// Variants that run side by side.
const LANES: usize = 32;
/// How often a draw is taken back by half, and one more.
const HALVES: usize = 16;

impl Tuning<'_> {
    /// Refuses parts that do not fit each other.
    pub fn check(&self) -> Result<()> {
        let states = self.limits.signals().states();
        let mut seen: Vec<usize> =
            self.observer.iter().flat_map(|observed| observed.states.clone()).collect();
        seen.sort_unstable();
        let commands = self.frame.commands();
        let fits = seen == (0..states).collect::<Vec<_>>()
            && self.observer.iter().all(|observed| {
                observed.states.len() == observed.chain.states
                    && observed.noise.sensors.len() == observed.chain.states
            })
            && self.free.iter().all(|&c| c < self.code.constants().len())
            && self.lags.iter().all(|group| !group.is_empty())
            && self.lags.iter().flatten().all(|&place| place < self.frame.actuation().times().len())
            && !self.records.is_empty()
            && self.records.iter().all(|record| {
                let steps = record.commands.len() / commands;
                record.commands.len() == steps * commands
                    && record.states.len() == (steps + 1) * states
                    && record.weights.len() == record.states.len()
            });
        if fits {
            Ok(())
        } else {
            invalid(
                "tuning: expected at least one record, and chains, records, constants and groups of lags that fit the \
                 model",
            )
        }
    }

    /// Levenberg's and Marquardt's method, at most `iterations` steps.
    pub fn tune(&self, iterations: usize, workers: &Workers) -> Tuned {
        let whitenings = self.whitenings();
        let mut best = self.start();
        let mut damping = 1e-3;
        let mut left = self.costs(&whitenings, std::slice::from_ref(&best), workers)[0];
        let mut covariance = vec![];
        for _ in 0..iterations {
            if !left.is_finite() {
                break;
            }
            let Some((gradient, curvature)) = self.normal(&whitenings, &best, workers) else { break };
            let tried: Vec<(f64, Variant)> = DAMPINGS
                .iter()
                .filter_map(|factor| {
                    let damping = (damping * factor).clamp(1e-12, 1e12);
                    Some((damping, self.moved(&best, &step(&gradient, &curvature, damping)?)))
                })
                .collect();
            let variants: Vec<_> = tried.iter().map(|(_, variant)| variant.clone()).collect();
            let costs = self.costs(&whitenings, &variants, workers);
            let found = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b]));
            let Some(found) = found.filter(|&found| costs[found] < left) else { break };
            let gained = left - costs[found];
            (damping, best) = tried[found].clone();
            left = costs[found];
            if gained < 1e-3 {
                break;
            }
        }
        if left.is_finite()
            && let Some((_, curvature)) = self.normal(&whitenings, &best, workers)
        {
            covariance = inverse(&curvature, &self.values(&best)).unwrap_or_default();
        }
        let readings =
            self.records.iter().map(|record| record.weights.iter().filter(|&&w| w > 0.0).count()).sum();
        Tuned { constants: best.constants, lags: best.lags, left, readings, covariance }
    }

    /// Tuned models with their free values drawn from what the runs leave open, one for each stream of random numbers.
    ///
    /// What is left is known where χ² is a parabola; a draw that leaves the place where it is one is taken back by
    /// halves until the runs bear it.
    pub fn drawn(
        &self,
        tuned: &Tuned,
        streams: impl IntoIterator<Item = Stream>,
        workers: &Workers,
    ) -> Vec<(Vec<f64>, Vec<f64>)> {
        let start = Variant { constants: tuned.constants.clone(), lags: tuned.lags.clone() };
        let size = self.size();
        let factor =
            (!tuned.covariance.is_empty()).then(|| Cholesky::new(&tuned.covariance, size, 0.0)).flatten();
        let tries: Vec<Variant> = streams
            .into_iter()
            .flat_map(|mut stream| {
                let normal: Vec<f64> = (0..size).map(|_| stream.gaussian()).collect();
                let step = factor.as_ref().map_or_else(|| vec![0.0; size], |factor| factor.times(&normal));
                let shares = std::iter::successors(Some(1.0), |share| Some(0.5 * share)).take(HALVES);
                let taken = |share: f64| {
                    let step: Vec<f64> = step.iter().map(|s| share * s).collect();
                    self.moved(&start, &step)
                };
                shares.map(taken).collect::<Vec<_>>()
            })
            .collect();
        if tries.is_empty() {
            // Most tunings draw nothing: no filter has to be run for them.
            return vec![];
        }
        let costs = self.costs(&self.whitenings(), &tries, workers);
        let bearable = tuned.left + size as f64 + 3.0 * (2.0 * size as f64).sqrt();
        let borne = |(tries, costs): (&[Variant], &[f64])| {
            let found = tries.iter().zip(costs).find(|(_, cost)| **cost <= bearable);
            let one = found.map_or(&start, |(one, _)| one);
            (one.constants.clone(), one.lags.clone())
        };
        tries.chunks_exact(HALVES).zip(costs.chunks_exact(HALVES)).map(borne).collect()
    }

    /// Whitened prediction errors of the model as it is, (n + 1) × n_x for each record, and its states once each
    /// reading was used; none where it diverges.
    pub fn predictions(&self, workers: &Workers) -> Option<Vec<(Vec<f64>, Vec<f64>)>> {
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
        finite.then(|| runs.into_iter().map(|run| (run.errors.concat(), run.states)).collect())
    }

    fn start(&self) -> Variant {
        Variant { constants: self.code.constants().to_vec(), lags: self.frame.actuation().times() }
    }

    fn size(&self) -> usize {
        self.free.len() + self.lags.len()
    }

    /// What is free to move, as it is in a variant.
    fn values(&self, variant: &Variant) -> Vec<f64> {
        let constants = self.free.iter().map(|&constant| variant.constants[constant]);
        constants.chain(self.lags.iter().map(|group| variant.lags[group[0]])).collect()
    }

    fn whitenings(&self) -> Vec<Vec<Whitening>> {
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

    fn moved(&self, from: &Variant, step: &[f64]) -> Variant {
        let mut to = from.clone();
        for (&c, step) in self.free.iter().zip(step) {
            to.constants[c] += step;
        }
        for (group, step) in self.lags.iter().zip(&step[self.free.len()..]) {
            for &command in group {
                // A lag stays one.
                to.lags[command] = (to.lags[command] + step).max(0.2 * from.lags[command]);
            }
        }
        to
    }

    /// χ² of each variant.
    fn costs(&self, whitenings: &[Vec<Whitening>], variants: &[Variant], workers: &Workers) -> Vec<f64> {
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

    /// Gradient and curvature (Gauss and Newton) of half of χ²; none if a variant diverges.
    fn normal(
        &self,
        whitenings: &[Vec<Whitening>],
        at: &Variant,
        workers: &Workers,
    ) -> Option<(Vec<f64>, Vec<f64>)> {
        let size = self.size();
        let mut steps = Vec::with_capacity(size);
        let mut variants = Vec::with_capacity(size);
        for (p, value) in self.values(at).into_iter().enumerate() {
            let mut step = vec![0.0; size];
            // A constant of 0 has no size; what is linear in it has the same slope for any step.
            let size = value.abs();
            step[p] = STEP * if size > f64::MIN_POSITIVE.sqrt() { size } else { STEP };
            steps.push(step[p]);
            variants.push(self.moved(at, &step));
        }
        let groups: Vec<Vec<Variant>> = variants
            .chunks(LANES - 1)
            .map(|chunk| std::iter::once(at.clone()).chain(chunk.iter().cloned()).collect())
            .collect();
        let parts = workers.map(self.records.len(), |r| {
            let mut gradient = vec![0.0; size];
            let mut curvature = vec![0.0; size * size];
            let mut base: Vec<f64> = vec![];
            let mut slopes: Vec<Vec<f64>> = Vec::with_capacity(size);
            for group in &groups {
                let part =
                    Part { tuning: self, record: r, whitenings: &whitenings[r], variants: group, keep: true };
                let run = dispatch(workers.width(), part);
                if run.diverged.iter().any(|&gone| gone) {
                    return None;
                }
                for varied in &run.errors[1..] {
                    let step = steps[slopes.len()];
                    slopes.push(varied.iter().zip(&run.errors[0]).map(|(a, b)| (a - b) / step).collect());
                }
                base = run.errors.into_iter().next().expect("the model itself");
            }
            for i in 0..size {
                gradient[i] = slopes[i].iter().zip(&base).map(|(s, e)| s * e).sum();
                for j in 0..=i {
                    let product: f64 = slopes[i].iter().zip(&slopes[j]).map(|(a, b)| a * b).sum();
                    curvature[i * size + j] = product;
                    curvature[j * size + i] = product;
                }
            }
            Some((gradient, curvature))
        });
        let (mut gradient, mut curvature) = (vec![0.0; size], vec![0.0; size * size]);
        for part in parts {
            let (g, c) = part?;
            gradient.iter_mut().zip(g).for_each(|(a, b)| *a += b);
            curvature.iter_mut().zip(c).for_each(|(a, b)| *a += b);
        }
        Some((gradient, curvature))
    }
}

/// The damped step, on parameters scaled by their curvature.
fn step(gradient: &[f64], curvature: &[f64], damping: f64) -> Option<Vec<f64>> {
    let size = gradient.len();
    let scales = scales(curvature, size);
    let mut matrix = vec![0.0; size * size];
    for i in 0..size {
        for j in 0..size {
            matrix[i * size + j] = curvature[i * size + j] * scales[i] * scales[j];
        }
        matrix[i * size + i] += damping + 1e-12;
    }
    let right: Vec<f64> = gradient.iter().zip(&scales).map(|(g, s)| -g * s).collect();
    let scaled = Cholesky::new(&matrix, size, 0.0)?.solve(&right);
    Some(scaled.iter().zip(&scales).map(|(x, s)| x * s).collect())
}

/// What the runs leave open of values that are known to their own size beforehand: where two constants of a program do
/// the same, no run tells them apart.
fn inverse(curvature: &[f64], values: &[f64]) -> Option<Vec<f64>> {
    let size = values.len();
    let scales = scales(curvature, size);
    let mut matrix = vec![0.0; size * size];
    for i in 0..size {
        for j in 0..size {
            matrix[i * size + j] = curvature[i * size + j] * scales[i] * scales[j];
        }
        let known = scales[i] / values[i].abs().max(f64::MIN_POSITIVE.sqrt());
        matrix[i * size + i] += 1e-9 + (known * known).min(1e12);
    }
    let inverse = Cholesky::new(&matrix, size, 0.0)?.inverse();
    Some((0..size * size).map(|ij| inverse[ij] * scales[ij / size] * scales[ij % size]).collect())
}

fn scales(curvature: &[f64], size: usize) -> Vec<f64> {
    (0..size).map(|i| 1.0 / curvature[i * size + i].max(f64::MIN_POSITIVE.sqrt()).sqrt()).collect()
}

/// Variants of a model on one record.
struct Part<'a> {
    tuning: &'a Tuning<'a>,
    record: usize,
    whitenings: &'a [Whitening],
    variants: &'a [Variant],
    keep: bool,
}

/// What a record makes of variants.
#[derive(Default)]
struct Run {
    /// χ² of each.
    squares: Vec<f64>,
    diverged: Vec<bool>,
    /// Whitened prediction errors of each, if they were to be kept.
    errors: Vec<Vec<f64>>,
    /// States of the first variant after each reading was used.
    states: Vec<f64>,
}

impl Kernel for Part<'_> {
    type Output = Run;

    #[inline(always)]
    fn run<W: Isa>(self) -> Run {
        let mut all = Run::default();
        for variants in self.variants.chunks(LANES) {
            let part = Part { variants, ..self };
            let run = with_test_lanes!(W, variants.len(), part.lanes());
            all.squares.extend(run.squares);
            all.diverged.extend(run.diverged);
            all.errors.extend(run.errors);
            if all.states.is_empty() {
                all.states = run.states;
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
        let (n_x, n_u) = (limits.signals().states(), frame.commands());
        let constants: Vec<&[f64]> = self.variants.iter().map(|variant| &variant.constants[..]).collect();
        let lags: Vec<&[f64]> = self.variants.iter().map(|variant| &variant.lags[..]).collect();
        let model = Model { code, frame };
        let mut workspace = model.variants::<V>(&pack(&constants), &pack(&lags));
        let mut state: Vec<V> = record.states[..n_x].iter().map(|&x| V::splat(x)).collect();
        let mut command = vec![V::splat(0.0); n_u];
        let mut gusts = vec![V::splat(0.0); observer.len()];
        let mut innovation = [V::splat(0.0); 4];
        let mut squares = V::splat(0.0);
        let mut alive = V::splat(1.0);
        let count = self.variants.len();
        let mut errors = vec![Vec::with_capacity(if self.keep { record.states.len() } else { 0 }); count];
        let mut states = Vec::with_capacity(if self.keep { record.states.len() } else { 0 });
        let steps = record.commands.len() / n_u;
        for k in 0..=steps {
            for ((observed, whitening), gust) in observer.iter().zip(self.whitenings).zip(&mut gusts) {
                let d = observed.states.len();
                let (gain, root) = (whitening.gain(k), whitening.root(k));
                for (i, &at) in observed.states.iter().enumerate() {
                    let reading = V::splat(record.states[k * n_x + at]);
                    innovation[i] = frame.periods().difference(at, reading, state[at]);
                }
                for (i, &at) in observed.states.iter().enumerate() {
                    let mut white = V::splat(0.0);
                    let mut correction = V::splat(0.0);
                    for l in 0..d {
                        white = white + innovation[l] * root[i * d + l];
                        correction = correction + innovation[l] * gain[i * d + l];
                    }
                    squares = squares + white * white;
                    state[at] = state[at] + correction;
                    if self.keep {
                        for (lane, errors) in errors.iter_mut().enumerate() {
                            errors.push(white.lane(lane));
                        }
                    }
                }
                if whitening.inner > d {
                    for l in 0..d {
                        *gust = *gust + innovation[l] * gain[d * d + l];
                    }
                }
            }
            if self.keep {
                states.extend(state.iter().map(|value| value.lane(0)));
            }
            if k == steps {
                break;
            }
            for (command, &value) in command.iter_mut().zip(&record.commands[k * n_u..]) {
                *command = V::splat(value);
            }
            step_apart(&model, &mut workspace, &mut state, &command);
            for ((observed, whitening), gust) in observer.iter().zip(self.whitenings).zip(&mut gusts) {
                if whitening.inner > observed.states.len() {
                    for (&at, reach) in observed.states.iter().zip(observed.chain.reach()) {
                        state[at] = state[at] + *gust * reach;
                    }
                    *gust = *gust * whitening.kept;
                }
            }
            for (state, &limit) in state.iter().zip(limits.magnitudes()) {
                alive = state.abs().select_less(V::splat(limit), alive, V::splat(0.0));
            }
            if !V::splat(0.0).any_less(alive) {
                break;
            }
        }
        Run {
            squares: (0..count).map(|lane| squares.lane(lane)).collect(),
            diverged: (0..count)
                .map(|lane| alive.lane(lane) == 0.0 || !squares.lane(lane).is_finite())
                .collect(),
            errors,
            states,
        }
    }
}
