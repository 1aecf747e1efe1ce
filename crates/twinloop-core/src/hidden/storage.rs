//! What is integrated with the states in the course of a run, point after point: what they fill, and what turns.

use super::{Hidden, Play, Source};
use crate::lanes::{Vector, numbers, vectors};

/// The hidden states of a model that are integrated with its own, with what a program sees of commands and of them.
#[derive(Clone)]
pub(crate) struct Storage<V> {
    stored: Stored,
    seen: Vec<V>,
}

impl<V: Vector> Storage<V> {
    /// At the start of a run, of those among some hidden states that are integrated, if there are any; the times of all, then
    /// those in which they turn, then their gaps, are given lane by lane, and steps of the integrator in s, `staged` if they
    /// are of Runge and Kutta. Factors are those of the states, then those of the commands.
    #[inline(never)]
    pub fn new(
        hidden: &[Hidden],
        factors: [&[f64]; 2],
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
        let stored = self.stored.see(&numbers(state), &seen);
        seen.extend(stored);
        self.seen = vectors(&seen);
        &self.seen
    }
}

/// What fills one of them.
#[derive(Clone)]
struct Inflow {
    states: Vec<usize>,
    commands: Vec<usize>,
    squared: bool,
    rest: f64,
    settled: bool,
}

impl Inflow {
    /// Of a hidden state that is integrated.
    fn of(hidden: &Hidden) -> Option<Self> {
        match &hidden.source {
            Source::Commands { .. } => None,
            Source::States { states, commands, rest, settled, .. } => Some(Self {
                states: states.clone(),
                commands: commands.clone(),
                squared: hidden.squared,
                rest: *rest,
                settled: *settled,
            }),
        }
    }

    /// What flows in on one lane of several, beyond its rest. Factors are those of the states, then those of commands.
    fn at(&self, states: &[f64], effects: &[f64], factors: &[f64], lanes: usize, lane: usize) -> f64 {
        let of_states = self.states.iter().map(|&i| states[i * lanes + lane] * factors[i]);
        let given = of_states.chain(
            self.commands.iter().map(|&j| effects[j * lanes + lane] * factors[states.len() / lanes + j]),
        );
        let sum: f64 = given.map(|given| if self.squared { given * given } else { given }).sum();
        sum * (1.0 / (self.states.len() + self.commands.len()) as f64) - self.rest
    }
}

/// What a stored number turns into.
#[derive(Clone, Copy)]
struct Partner {
    /// Its place among the numbers stored.
    place: usize,
    /// How much of it leaves for the partner's every unit, 1 / s: below 0 for the second of a pair.
    rate: f64,
    /// The gap between them.
    play: Option<Play>,
}

/// What states have filled, in the course of a run.
///
/// Lane by lane: few laws have any, and arithmetic on vectors would be compiled for each of them. There is a number for
/// each hidden state and lane, in this order.
#[derive(Clone)]
struct Stored {
    inflows: Vec<Inflow>,
    /// One over the scale of each state, then of each command.
    factors: Vec<f64>,
    lanes: usize,
    /// Step of the integrator, s, and whether it is one of Runge and Kutta; else one by the rule of trapezoids.
    dt: f64,
    staged: bool,
    /// Time constant of each number, s.
    times: Vec<f64>,
    partners: Vec<Option<Partner>>,
    now: Vec<f64>,
    /// Slope at the last point seen, and the weighted sum of those of the step.
    slope: Vec<f64>,
    sum: Vec<f64>,
    /// The next point is of this stage of the integrator; none: it is the first of the run.
    stage: Option<usize>,
}

impl Stored {
    /// At the start of a run, of those among some hidden states that are integrated, whose times are given lane by lane.
    fn new(
        hidden: &[Hidden],
        factors: [&[f64]; 2],
        times: &[f64],
        lanes: usize,
        dt: f64,
        staged: bool,
    ) -> Option<Self> {
        let first = hidden.iter().position(Hidden::moves)?;
        let (times, turns) = times.split_at(hidden.len() * lanes);
        let times = times[first * lanes..].to_vec();
        let empty = vec![0.0; times.len()];
        Some(Self {
            inflows: hidden.iter().filter_map(Inflow::of).collect(),
            factors: factors.concat(),
            lanes,
            dt,
            staged,
            partners: partners(&hidden[first..], turns, lanes),
            times,
            now: empty.clone(),
            slope: empty.clone(),
            sum: empty,
            stage: None,
        })
    }

    /// The numbers at the integrator's next point, at which these are the states and the effects of commands.
    fn see(&mut self, state: &[f64], effects: &[f64]) -> Vec<f64> {
        let inflow = self.inflow(state, effects);
        if self.stage.is_none() {
            self.settle(&inflow);
        }
        let points = self.points(&inflow);
        let presses = self.presses(&points, &inflow);
        self.slope = (0..points.len()).map(|i| self.slope_at(i, &presses, &points, &inflow)).collect();
        if self.staged {
            self.sum_up();
        } else {
            self.now.clone_from(&points);
        }
        self.stage = Some(if self.staged { (self.stage.unwrap_or(0) + 1) % SIXTHS.len() } else { 0 });
        presses
    }

    /// What is seen at points: the points, but for twists of a gap what presses there.
    fn presses(&self, points: &[f64], inflow: &[f64]) -> Vec<f64> {
        let of = |i: usize| match self.partners[i] {
            Some(Partner { place, rate, play: Some(play) }) if rate > 0.0 => {
                play.press(points[i], inflow[i] - points[place])
            }
            _ => points[i],
        };
        (0..points.len()).map(of).collect()
    }

    /// What flows into each number.
    fn inflow(&self, state: &[f64], effects: &[f64]) -> Vec<f64> {
        let lanes = self.lanes;
        let of = |i: usize| self.inflows[i / lanes].at(state, effects, &self.factors, lanes, i % lanes);
        (0..self.now.len()).map(of).collect()
    }

    /// Fills those that a run begins with settled, so that they stay as they are under this inflow.
    fn settle(&mut self, inflow: &[f64]) {
        for (i, &flow) in inflow.iter().enumerate() {
            let settled = self.inflows[i / self.lanes].settled;
            self.now[i] = match self.partners[i] {
                // What is behind a gap moves along.
                Some(Partner { rate, play: Some(_), .. }) if rate < 0.0 => flow,
                Some(_) if settled => self.solved(i, 0.0, 1.0, inflow),
                None if settled => flow * self.times[i],
                _ => continue,
            };
        }
    }

    /// The numbers at the next point, from those at the start of the step.
    fn points(&self, inflow: &[f64]) -> Vec<f64> {
        let stage = self.stage.unwrap_or(0);
        if self.staged && stage > 0 {
            let ahead = NEXT[stage - 1] * self.dt;
            self.now.iter().zip(&self.slope).map(|(now, slope)| now + slope * ahead).collect()
        } else if self.staged || self.stage.is_none() {
            self.now.clone()
        } else {
            self.by_trapezoids(inflow)
        }
    }

    /// The numbers at the end of a step. What it has added is known once the state there is.
    fn by_trapezoids(&self, inflow: &[f64]) -> Vec<f64> {
        let half = 0.5 * self.dt;
        let known = |i: usize| self.now[i] + half * (self.slope[i] + inflow[i]);
        let added: Vec<f64> = (0..self.now.len()).map(known).collect();
        (0..self.now.len()).map(|i| self.solved(i, 1.0, half, &added)).collect()
    }

    /// Slope of one number at a point.
    fn slope_at(&self, i: usize, presses: &[f64], points: &[f64], inflow: &[f64]) -> f64 {
        let fading = points[i] / self.times[i];
        match self.partners[i] {
            None => inflow[i] - fading,
            Some(Partner { place, rate, play: None }) => inflow[i] - fading - points[place] * rate,
            Some(Partner { place, rate, .. }) if rate > 0.0 => inflow[i] - points[place],
            Some(Partner { place, rate, .. }) => presses[place] * (rate * rate) - fading,
        }
    }

    /// Adds the slope of this stage to the sum of the step, and moves on after the last stage.
    fn sum_up(&mut self) {
        let stage = self.stage.unwrap_or(0);
        for i in 0..self.now.len() {
            let weighted = self.slope[i] * SIXTHS[stage];
            self.sum[i] = if stage > 0 { self.sum[i] + weighted } else { weighted };
            if stage == SIXTHS.len() - 1 {
                self.now[i] += self.sum[i] * (self.dt / 6.0);
            }
        }
    }

    /// One of what solves `own` h + `share` (h / time + what it turns into) = `right`, for each of them.
    fn solved(&self, i: usize, own: f64, share: f64, right: &[f64]) -> f64 {
        let fades = own + share / self.times[i];
        let Some(Partner { place, rate, .. }) = self.partners[i] else { return right[i] / fades };
        let (others, turned) = (own + share / self.times[place], share * rate);
        (right[i] * others - turned * right[place]) / (fades * others + turned * turned)
    }
}

/// The partner of each number; those that turn come in pairs. The times in which they do, then half of each gap and its
/// damping, are given lane by lane.
fn partners(hidden: &[Hidden], turns: &[f64], lanes: usize) -> Vec<Option<Partner>> {
    let mut partners = Vec::with_capacity(hidden.len() * lanes);
    let (mut turning, mut playing) = (0, hidden.iter().filter(|one| one.turns().is_some()).count());
    for (k, kind) in hidden.iter().enumerate() {
        if kind.turns().is_none() {
            partners.resize(partners.len() + lanes, None);
            continue;
        }
        let (other, side) = if turning % 2 == 0 { (k + 1, 1.0) } else { (k - 1, -1.0) };
        let times = &turns[turning * lanes..][..lanes];
        let gaps = kind.play().map(|_| &turns[playing * lanes..][..2 * lanes]);
        playing += 2 * usize::from(gaps.is_some());
        let on_lane = |(lane, time): (usize, &f64)| Partner {
            place: other * lanes + lane,
            rate: side / time,
            play: gaps.map(|gaps| Play { half: gaps[lane], damping: gaps[lanes + lane] }),
        };
        partners.extend(times.iter().enumerate().map(on_lane).map(Some));
        turning += 1;
    }
    partners
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

    fn filled_by_the_second(squared: bool, settled: bool, turns: Option<f64>) -> Hidden {
        Hidden {
            source: Source::States {
                states: vec![1],
                commands: vec![],
                rest: 0.25,
                settled,
                turns,
                play: None,
            },
            squared,
            time: 0.3,
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
                let hidden = filled_by_the_second(squared, settled, None);
                let mut storage =
                    Storage::<Wide<f64, 2>>::new(&[hidden], [&[1.0, 0.25], &[]], &TIMES, DT, staged).unwrap();
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
                let one = Hidden { time, ..filled_by_the_second(false, settled, Some(turns)) };
                let pair = [one.clone(), one];
                let times = [time, time, time, time, turns, turns, turns, turns];
                let mut storage =
                    Storage::<Wide<f64, 2>>::new(&pair, [&[1.0, 0.25], &[]], &times, 0.1 * DT, staged)
                        .unwrap();
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
    fn a_mass_behind_a_gap_moves_as_its_equations_say() {
        let (time, turns, play) = (0.5, 0.02, Play { half: 0.003, damping: 0.004 });
        let source = Source::States {
            commands: vec![],
            states: vec![1],
            rest: 0.0,
            settled: false,
            turns: Some(turns),
            play: Some(play),
        };
        let one = Hidden { source, squared: false, time };
        let times = [time, time, turns, turns, play.half, play.damping, play.half, play.damping];
        let times: Vec<f64> = times.iter().flat_map(|&time| [time; 2]).collect();
        let step = 0.02 * DT;
        let mut storage =
            Storage::<Wide<f64, 2>>::new(&[one.clone(), one], [&[1.0, 0.25], &[]], &times, step, true)
                .unwrap();
        let filled = |t: f64| (40.0 * t).cos() - 0.5;
        let mut z = [0.0, filled(0.0)];
        // Springs and dampers that never pull, on either side.
        let press = |twist: f64, rate: f64| {
            if twist > play.half {
                (twist - play.half + play.damping * rate).max(0.0).min(100.0 * (twist - play.half))
            } else if twist < -play.half {
                (twist + play.half + play.damping * rate).min(0.0).max(100.0 * (twist + play.half))
            } else {
                0.0
            }
        };
        let mut pressed = 0;
        for k in 0..1500 {
            let t = f64::from(k) * step;
            let at = |share: f64| [Wide::splat(7.0), Wide::splat(4.0 * filled(t + share * step))];
            let seen: Vec<_> =
                [0.0, 0.5, 0.5, 1.0].iter().map(|&share| storage.see(&at(share), &[]).to_vec()).collect();
            let expected = [press(z[0], filled(t) - z[1]), z[1]];
            pressed += usize::from(expected[0] != 0.0);
            for (part, expected) in expected.into_iter().enumerate() {
                for lane in 0..2 {
                    let found = seen[0][part].lane(lane);
                    assert!((found - expected).abs() < 3e-3, "{k} {part}: {found} {expected}");
                }
            }
            for part in 0..100 {
                let (h, now) = (1e-2 * step, t + f64::from(part) * 1e-2 * step);
                let slope = |z: [f64; 2], t: f64| {
                    let rate = filled(t) - z[1];
                    [rate, press(z[0], rate) / (turns * turns) - z[1] / time]
                };
                let first = slope(z, now);
                let second = slope([z[0] + 0.5 * h * first[0], z[1] + 0.5 * h * first[1]], now + 0.5 * h);
                z = [z[0] + h * second[0], z[1] + h * second[1]];
            }
        }
        assert!((250..1450).contains(&pressed), "{pressed}");
    }

    #[test]
    fn a_pair_that_a_command_fills_turns_and_fades_as_its_equations_say() {
        let (time, turns) = (0.5, 0.04);
        let one = Hidden {
            source: Source::States {
                states: vec![],
                commands: vec![1],
                rest: 0.25,
                settled: false,
                turns: Some(turns),
                play: None,
            },
            squared: false,
            time,
        };
        let times = [time, time, time, time, turns, turns, turns, turns];
        // Scales of two states, then of two commands.
        let factors = [1.0, 0.25, 1.0, 0.5];
        let step = 0.1 * DT;
        let mut storage = Storage::<Wide<f64, 2>>::new(
            &[one.clone(), one],
            [&factors[..2], &factors[2..]],
            &times,
            step,
            true,
        )
        .unwrap();
        let effects = [Wide::splat(-1.0), Wide::splat(2.5)];
        // z = h1 + i h2 of z' = (1 + i) f - (1 / time - i / turns) z begins at 0: z = (1 + i) f (1 - exp(-a t)) / a.
        let (fades, turned, filled) = (1.0 / time, -1.0 / turns, 2.5 * 0.5 - 0.25);
        for k in 0..100 {
            let t = f64::from(k) * step;
            let seen: Vec<_> = (0..4)
                .map(|_| storage.see(&[Wide::splat(7.0), Wide::splat(4.0)], &effects).to_vec())
                .collect();
            let (size, angle) = ((-fades * t).exp(), -turned * t);
            let gone = [1.0 - size * angle.cos(), -size * angle.sin()];
            let above = [filled * (gone[0] - gone[1]), filled * (gone[0] + gone[1])];
            let square = fades * fades + turned * turned;
            let expected = [
                (above[0] * fades + above[1] * turned) / square,
                (above[1] * fades - above[0] * turned) / square,
            ];
            for lane in 0..2 {
                let found = [seen[0][2].lane(lane), seen[0][3].lane(lane)];
                for i in 0..2 {
                    assert!((found[i] - expected[i]).abs() < 1e-6, "{found:?} is not {expected:?} at {t}");
                }
            }
        }
    }

    #[test]
    fn what_commands_fill_is_no_storage() {
        let source = Source::Commands { commands: vec![0], rest: None };
        let by_commands = Hidden { source, squared: true, time: 0.3 };
        assert!(Storage::<Wide<f64, 2>>::new(&[by_commands], [&[1.0], &[]], &TIMES, DT, true).is_none());
    }
}
