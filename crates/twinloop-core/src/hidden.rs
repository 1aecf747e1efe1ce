//! Hidden states that commands or motion fill and that fade: what many periods of thrust, heat, current or speed leave in
//! a machine and no sensor reads.

use crate::error::{Result, invalid};
use crate::lanes::{Vector, numbers, vectors};

/// A hidden state h of a model: dh/dt = mean over its sources of what each gives − the same at rest − h / time.
///
/// Two neighbours may turn into each other, as the place and the speed of a mass on a spring do: then −h₂ / turns is added
/// to the first one's, and h₁ / turns to the second one's.
///
/// Its sources are commands or states. Each gives itself, or its square, in units of its scale; h is 0 at the start of a
/// run, or where it neither fills nor empties there, and an input of the model's program after the commands.
#[derive(Clone, Debug, PartialEq)]
pub struct Hidden {
    /// Commands that fill it; none where states do.
    pub commands: Vec<usize>,
    /// States that fill it; none where commands do.
    pub states: Vec<usize>,
    /// Whether they do so with their squares.
    pub squared: bool,
    /// The mean at which it neither fills nor empties; none, where commands fill it: that of the first period.
    pub rest: Option<f64>,
    /// Whether a run begins with it settled at what fills it then, and not empty; only where states fill it.
    pub settled: bool,
    /// Its time constant, s.
    pub time: f64,
    /// In which it and its partner turn by one radian, s; 0 where it has none. Only where states fill it.
    pub turns: f64,
}

impl Hidden {
    /// Refuses what is no such state of so many commands and states.
    pub fn validated(self, commands: usize, states: usize) -> Result<Self> {
        let fits = self.commands.is_empty() != self.states.is_empty()
            && self.commands.iter().all(|&command| command < commands)
            && self.states.iter().all(|&state| state < states)
            && (self.commands.is_empty() || !self.settled)
            && (self.states.is_empty() || self.rest.is_some())
            && self.turns.is_finite()
            && self.turns >= 0.0
            && (self.turns == 0.0 || self.moves())
            && self.rest.is_none_or(f64::is_finite)
            && self.time.is_finite()
            && self.time > 0.0;
        if fits {
            Ok(self)
        } else {
            invalid(format!(
                "hidden state: expected some of {commands} commands, or some of {states} states with a rest, a finite \
                 rest, a time above 0 s and turns only of states, found {self:?}"
            ))
        }
    }

    /// Whether it has a partner.
    pub(crate) fn turning(&self) -> bool {
        self.turns > 0.0
    }

    /// Whether states fill it.
    pub(crate) fn moves(&self) -> bool {
        !self.states.is_empty()
    }

    /// What states fill it with on one lane of several, beyond its rest.
    fn filling(&self, states: &[f64], factors: &[f64], lanes: usize, lane: usize) -> f64 {
        let given = self.states.iter().map(|&i| states[i * lanes + lane] * factors[i]);
        let sum: f64 = given.map(|given| if self.squared { given * given } else { given }).sum();
        sum * (1.0 / self.states.len() as f64) - self.rest.unwrap_or(0.0)
    }
}

/// A hidden state in the course of a run.
#[derive(Clone)]
pub(crate) struct Filling<V> {
    hidden: Hidden,
    /// Its decay over half a period, a factor.
    decay: V,
    /// What half a period adds to it for each unit of input.
    gain: V,
    rest: Option<V>,
    now: V,
}

impl<V: Vector> Filling<V> {
    /// An empty one. Half a period multiplies it by `decay`, and adds `gain` for each unit of input.
    pub fn new(hidden: &Hidden, decay: V, gain: V) -> Self {
        let rest = hidden.rest.map(V::splat);
        Self { hidden: hidden.clone(), decay, gain, rest, now: V::splat(0.0) }
    }

    /// Its values at the start, the middle and the end of a period with these commands, in units of 1 / `factors`.
    #[inline(always)]
    pub fn pass(&mut self, command: &[V], factors: &[f64]) -> [V; 3] {
        let mut level = V::splat(0.0);
        for &i in &self.hidden.commands {
            let given = command[i] * factors[i];
            level = level + if self.hidden.squared { given * given } else { given };
        }
        level = level * (1.0 / self.hidden.commands.len() as f64);
        let rest = *self.rest.get_or_insert(level);
        let added = (level - rest) * self.gain;
        let start = self.now;
        let middle = start * self.decay + added;
        self.now = middle * self.decay + added;
        [start, middle, self.now]
    }
}

/// The hidden states of a model that its own states fill, with what a program sees of commands and of them.
#[derive(Clone)]
pub(crate) struct Storage<V> {
    stored: Stored,
    seen: Vec<V>,
}

impl<V: Vector> Storage<V> {
    /// At the start of a run, of those among some hidden states that states fill, if there are any; the times of all, then
    /// those in which they turn, are given lane by lane, and steps of the integrator in s, `staged` if they are of Runge and
    /// Kutta.
    #[inline(never)]
    pub fn new(
        hidden: &[Hidden],
        factors: &[f64],
        times: &[f64],
        dt: f64,
        staged: bool,
    ) -> Option<Box<Self>> {
        let stored = Stored::new(hidden, factors, times, V::LANES, dt, staged)?;
        Some(Box::new(Self { stored, seen: vec![] }))
    }

    /// What a program sees at the integrator's next point: effects of commands, then what is stored.
    #[inline(never)]
    pub fn see(&mut self, state: &[V], effects: &[V]) -> &[V] {
        let mut seen = numbers(effects);
        self.stored.see(&numbers(state), &mut seen);
        self.seen = vectors(&seen);
        &self.seen
    }
}

/// What states have filled, in the course of a run.
///
/// Lane by lane: few laws have any, and arithmetic on vectors would be compiled for each of them.
#[derive(Clone)]
struct Stored {
    kinds: Vec<Hidden>,
    /// One over the scale of each state.
    factors: Vec<f64>,
    /// Step of the integrator, s, and whether it is one of Runge and Kutta; else one by the rule of trapezoids.
    dt: f64,
    staged: bool,
    /// The partner of each, which comes after it (1.0) or before it (-1.0); itself where it has none (0.0).
    partners: Vec<(usize, f64)>,
    /// Time of each on every lane, s; and so on.
    times: Vec<f64>,
    /// One over the time in which it turns, radians / s.
    rates: Vec<f64>,
    now: Vec<f64>,
    /// Slope at the last point seen, and the weighted sum of those of the step.
    slope: Vec<f64>,
    sum: Vec<f64>,
    /// The next point is of this stage of the integrator; none: it is the first of the run.
    stage: Option<usize>,
}

impl Stored {
    /// At the start of a run, of those among some hidden states that states fill, whose times are given lane by lane.
    fn new(
        hidden: &[Hidden],
        factors: &[f64],
        times: &[f64],
        lanes: usize,
        dt: f64,
        staged: bool,
    ) -> Option<Self> {
        let first = hidden.iter().position(Hidden::moves)?;
        let (times, mut turning) = times.split_at(hidden.len() * lanes);
        let (kinds, times) = (hidden[first..].to_vec(), times[first * lanes..].to_vec());
        let (mut partners, mut rates) = (vec![], vec![]);
        for (k, kind) in kinds.iter().enumerate() {
            if kind.turning() {
                let (own, others) = turning.split_at(lanes);
                turning = others;
                rates.extend(own.iter().map(|time| 1.0 / time));
                // Those that turn come in pairs.
                let before: Option<&(usize, f64)> = partners.last();
                let second = before.is_some_and(|&(partner, side)| side > 0.0 && partner == k);
                partners.push(if second { (k - 1, -1.0) } else { (k + 1, 1.0) });
            } else {
                rates.extend(vec![0.0; lanes]);
                partners.push((k, 0.0));
            }
        }
        let empty = || vec![0.0; times.len()];
        Some(Self {
            factors: factors.to_vec(),
            dt,
            staged,
            now: empty(),
            slope: empty(),
            sum: empty(),
            kinds,
            partners,
            times,
            rates,
            stage: None,
        })
    }

    fn see(&mut self, state: &[f64], seen: &mut Vec<f64>) {
        let lanes = state.len() / self.factors.len();
        let (first, stage) = (self.stage.is_none(), self.stage.unwrap_or(0));
        let filling: Vec<f64> = (0..self.now.len())
            .map(|i| self.kinds[i / lanes].filling(state, &self.factors, lanes, i % lanes))
            .collect();
        if first {
            for i in (0..self.now.len()).filter(|i| self.kinds[i / lanes].settled) {
                let turning = self.kinds[i / lanes].turning();
                self.now[i] = if turning {
                    self.solved(i, lanes, 0.0, 1.0, &filling)
                } else {
                    filling[i] * self.times[i]
                };
            }
        }
        let half = 0.5 * self.dt;
        let points: Vec<f64> = if self.staged && stage > 0 {
            let ahead = NEXT[stage - 1] * self.dt;
            self.now.iter().zip(&self.slope).map(|(now, slope)| now + slope * ahead).collect()
        } else if self.staged || first {
            self.now.clone()
        } else {
            // What the last period has added is known once the state at its end is.
            let added: Vec<f64> =
                (0..self.now.len()).map(|i| self.now[i] + half * (self.slope[i] + filling[i])).collect();
            (0..self.now.len()).map(|i| self.solved(i, lanes, 1.0, half, &added)).collect()
        };
        for i in 0..self.now.len() {
            self.slope[i] = filling[i] - points[i] / self.times[i];
            let (partner, side) = self.partners[i / lanes];
            if side != 0.0 {
                self.slope[i] -= side * points[partner * lanes + i % lanes] * self.rates[i];
            }
            if self.staged {
                let weighted = self.slope[i] * SIXTHS[stage];
                self.sum[i] = if stage > 0 { self.sum[i] + weighted } else { weighted };
                if stage == SIXTHS.len() - 1 {
                    self.now[i] += self.sum[i] * (self.dt / 6.0);
                }
            }
        }
        if !self.staged {
            self.now.clone_from(&points);
        }
        seen.extend(points);
        self.stage = Some(if self.staged { (stage + 1) % SIXTHS.len() } else { 0 });
    }

    /// One of what solves `own` h + `share` (h / time + what it turns into) = `right`, for each of them.
    fn solved(&self, i: usize, lanes: usize, own: f64, share: f64, right: &[f64]) -> f64 {
        let (partner, side) = self.partners[i / lanes];
        let j = partner * lanes + i % lanes;
        let (fades, others) = (own + share / self.times[i], own + share / self.times[j]);
        if side == 0.0 {
            return right[i] / fades;
        }
        let turned = share * self.rates[i];
        (right[i] * others - side * turned * right[j]) / (fades * others + turned * turned)
    }
}

/// Shares of a step from its start to the next stage's point, and the weights of the stages, as the integrator has them.
const NEXT: [f64; 3] = [0.5, 0.5, 1.0];
const SIXTHS: [f64; 4] = [1.0, 2.0, 2.0, 1.0];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Wide;

    const DT: f64 = 0.02;
    const TIMES: [f64; 2] = [0.3, 0.05];

    fn filled_by_the_second(squared: bool, settled: bool) -> Hidden {
        Hidden {
            commands: vec![],
            states: vec![1],
            squared,
            rest: Some(0.25),
            settled,
            time: 0.3,
            turns: 0.0,
        }
    }

    /// What a state of 4 (1 + t), in units of 4, has filled by a time: h' = 1 + t − rest − h / T, or with (1 + t)².
    fn exact(t: f64, time: f64, squared: bool, settled: bool) -> f64 {
        // A particular solution a + b t + c t², and what fades of the difference at the start.
        let (first, second, third) = if squared { (0.75, 2.0, 1.0) } else { (0.75, 1.0, 0.0) };
        let c = third * time;
        let b = (second - 2.0 * c) * time;
        let a = (first - b) * time;
        let begun = if settled { 0.75 * time } else { 0.0 };
        a + b * t + c * t * t + (begun - a) * (-t / time).exp()
    }

    fn state(t: f64) -> [Wide<f64, 2>; 2] {
        [Wide::splat(7.0), Wide::splat(4.0 * (1.0 + t))]
    }

    #[test]
    fn what_a_moving_state_fills_is_what_its_equation_says_on_every_lane() {
        for (squared, settled) in [(false, false), (false, true), (true, false), (true, true)] {
            for (staged, close) in [(true, 2e-5), (false, 2e-3)] {
                let hidden = filled_by_the_second(squared, settled);
                let mut storage =
                    Storage::<Wide<f64, 2>>::new(&[hidden], &[1.0, 0.25], &TIMES, DT, staged).unwrap();
                let effects = [Wide::splat(-1.0)];
                for k in 0..40 {
                    let t = f64::from(k) * DT;
                    let shares: &[f64] = if staged { &[0.0, 0.5, 0.5, 1.0] } else { &[0.0] };
                    let seen: Vec<_> = shares
                        .iter()
                        .map(|share| storage.see(&state(t + share * DT), &effects).to_vec())
                        .collect();
                    for (lane, time) in TIMES.into_iter().enumerate() {
                        let found = seen[0][1].lane(lane);
                        assert_eq!(seen[0][0].lane(lane), -1.0);
                        let expected = exact(t, time, squared, settled);
                        assert!(
                            (found - expected).abs() < close,
                            "{squared} {settled} {staged} {k}: {found} {expected}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn a_pair_turns_and_fades_as_its_equations_say() {
        let (time, turns) = (0.5, 0.04);
        for settled in [false, true] {
            for (staged, close) in [(true, 2e-4), (false, 2e-3)] {
                let one = Hidden { turns, time, ..filled_by_the_second(false, settled) };
                let pair = [one.clone(), one];
                let times = [time, time, time, time, turns, turns, turns, turns];
                let mut storage =
                    Storage::<Wide<f64, 2>>::new(&pair, &[1.0, 0.25], &times, 0.1 * DT, staged).unwrap();
                // The complex number z = h1 + i h2 obeys z' = (1 + i) (0.75 + t) - (1 / time - i / turns) z.
                let mut z = [0.0, 0.0];
                let slope = |z: [f64; 2], t: f64| {
                    [0.75 + t - z[0] / time - z[1] / turns, 0.75 + t - z[1] / time + z[0] / turns]
                };
                if settled {
                    let (fades, turned) = (1.0 / time, 1.0 / turns);
                    let det = fades * fades + turned * turned;
                    z = [0.75 * (fades - turned) / det, 0.75 * (fades + turned) / det];
                    assert!(slope(z, 0.0).iter().all(|rate| rate.abs() < 1e-12));
                }
                for k in 0..300 {
                    let t = f64::from(k) * 0.1 * DT;
                    let shares: &[f64] = if staged { &[0.0, 0.5, 0.5, 1.0] } else { &[0.0] };
                    let seen: Vec<_> =
                        shares.iter().map(|s| storage.see(&state(t + s * 0.1 * DT), &[]).to_vec()).collect();
                    for (part, expected) in z.into_iter().enumerate() {
                        for lane in 0..2 {
                            let found = seen[0][part].lane(lane);
                            assert!(
                                (found - expected).abs() < close,
                                "{settled} {staged} {k}: {found} {expected}"
                            );
                        }
                    }
                    // A hundred small steps of the midpoint rule.
                    for part in 0..100 {
                        let (h, now) = (1e-3 * DT, t + f64::from(part) * 1e-3 * DT);
                        let first = slope(z, now);
                        let second =
                            slope([z[0] + 0.5 * h * first[0], z[1] + 0.5 * h * first[1]], now + 0.5 * h);
                        z = [z[0] + h * second[0], z[1] + h * second[1]];
                    }
                }
            }
        }
    }

    #[test]
    fn what_fills_nothing_is_no_storage_and_what_does_not_fit_is_refused() {
        let by_commands = Hidden { commands: vec![0], states: vec![], ..filled_by_the_second(true, false) };
        assert!(
            Storage::<Wide<f64, 2>>::new(std::slice::from_ref(&by_commands), &[1.0], &TIMES, DT, true)
                .is_none()
        );
        assert!(by_commands.clone().validated(1, 2).is_ok());
        assert!(filled_by_the_second(true, true).validated(1, 2).is_ok());
        for wrong in [
            filled_by_the_second(true, true).validated(1, 1),
            Hidden { rest: None, ..filled_by_the_second(true, true) }.validated(1, 2),
            Hidden { commands: vec![0], ..filled_by_the_second(true, false) }.validated(1, 2),
            Hidden { settled: true, ..by_commands.clone() }.validated(1, 2),
            Hidden { commands: vec![], ..by_commands }.validated(1, 2),
        ] {
            assert!(wrong.is_err());
        }
    }
}
