//! Actuation: what stands between commands and a model. Each command has an actuator with a delay and a first-order
//! lag, and may move at a limited rate: de/dt = clip((u − e) / lag, ± rate). Hidden states that commands fill may follow,
//! and after these some that are integrated with the states.

use crate::error::{Result, invalid};
use crate::hidden::{Filling, Hidden, Play};
use crate::lanes::{Vector, vectors, zeros};

/// The way from one command to its effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuator {
    /// Time constant of the lag, s; 0 for none.
    pub lag: f64,
    /// Whole periods before a command begins to act.
    pub delay: usize,
    /// Command whose effect is there at the start of a run; none: the first one.
    pub rest: Option<f64>,
    /// Time in which the effect moves by one scale of the command at most, s; 0 where no limit is known.
    pub ramp: f64,
}

impl Actuator {
    /// A command that acts at once.
    pub const DIRECT: Self = Self { lag: 0.0, delay: 0, rest: None, ramp: 0.0 };
    /// More periods of delay than this are refused.
    pub const LONGEST_DELAY: usize = 1000;

    /// Refuses what no actuator has.
    pub fn validated(self) -> Result<Self> {
        let time = |time: f64| time.is_finite() && time >= 0.0;
        let fits = time(self.lag) && time(self.ramp) && self.rest.is_none_or(f64::is_finite);
        if !fits || self.delay > Self::LONGEST_DELAY {
            return invalid(format!(
                "actuator: expected a lag and a ramp of at least 0 s, a delay of at most {} periods and a finite rest, \
                 found {self:?}",
                Self::LONGEST_DELAY
            ));
        }
        Ok(self)
    }

    fn is_direct(&self) -> bool {
        self.lag == 0.0 && self.delay == 0 && self.ramp == 0.0
    }
}

/// What a model sees of commands: their effects, then the states that they fill.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Actuation {
    /// One a command, or none at all where every command acts at once and nothing is hidden.
    pub actuators: Vec<Actuator>,
    /// States that commands fill, then those that are integrated with the states.
    pub hidden: Vec<Hidden>,
}

impl Actuation {
    /// Refuses parts that do not fit so many commands and states.
    pub fn validated(self, commands: usize, states: usize) -> Result<Self> {
        if self.actuators.len() != commands {
            return invalid(format!(
                "actuators: expected one for each of {commands} commands, found {}",
                self.actuators.len()
            ));
        }
        let actuators = self.actuators.into_iter().map(Actuator::validated).collect::<Result<Vec<_>>>()?;
        let hidden: Vec<_> = self
            .hidden
            .into_iter()
            .map(|hidden| hidden.validated(commands, states))
            .collect::<Result<_>>()?;
        if !hidden.is_sorted_by_key(Hidden::moves) {
            return invalid(
                "hidden states: expected those that commands fill before those that are integrated",
            );
        }
        let turning: Vec<usize> = (0..hidden.len()).filter(|&i| hidden[i].turns().is_some()).collect();
        let paired = |pair: &[usize]| matches!(pair, &[i, j] if j == i + 1 && hidden[i] == hidden[j]);
        if !turning.chunks(2).all(paired) {
            return invalid(
                "hidden states: expected those that turn in pairs of neighbours that the same fills",
            );
        }
        let direct = hidden.is_empty() && actuators.iter().all(Actuator::is_direct);
        Ok(Self { actuators: if direct { vec![] } else { actuators }, hidden })
    }

    /// Whether a model sees commands as they are sent.
    pub fn is_direct(&self) -> bool {
        self.actuators.is_empty()
    }

    /// Lag of each actuator, then time of each hidden state, then the time in which each that has a partner turns, then
    /// half the gap and the damping of each that has a gap before it, then the ramp of each actuator that has one, s.
    pub fn times(&self) -> Vec<f64> {
        let lags = self.actuators.iter().map(|actuator| actuator.lag);
        let times = self.hidden.iter().map(|hidden| hidden.time);
        let turns = self.hidden.iter().filter_map(Hidden::turns);
        let gaps = self.hidden.iter().filter_map(Hidden::play).flat_map(|play| [play.half, play.damping]);
        lags.chain(times)
            .chain(turns)
            .chain(gaps)
            .chain(self.ramping().map(|i| self.actuators[i].ramp))
            .collect()
    }

    /// Commands whose effects move at a limited rate.
    fn ramping(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.actuators.len()).filter(|&i| self.actuators[i].ramp > 0.0)
    }

    /// The same, each on so many lanes, lane by lane.
    pub fn times_on(&self, lanes: usize) -> Vec<f64> {
        self.times().into_iter().flat_map(|time| vec![time; lanes]).collect()
    }

    /// The same with other lags and times.
    pub fn with_times(&self, times: &[f64]) -> Result<Self> {
        let expected = self.times().len();
        if times.len() != expected {
            return invalid(format!("lags: expected {expected}, found {}", times.len()));
        }
        let mut other = self.clone();
        let (times, ramps) = times.split_at(expected - self.ramping().count());
        self.ramping().zip(ramps).for_each(|(i, &ramp)| other.actuators[i].ramp = ramp);
        let (lags, rest) = times.split_at(self.actuators.len());
        let (rest, turns) = rest.split_at(self.hidden.len());
        let (turns, gaps) = turns.split_at(self.hidden.iter().filter_map(Hidden::turns).count());
        let turning = other.hidden.iter_mut().filter_map(Hidden::turns_mut);
        turning.zip(turns).for_each(|(turns, &time)| *turns = time);
        let playing = other.hidden.iter_mut().filter_map(Hidden::play_mut);
        playing
            .zip(gaps.chunks_exact(2))
            .for_each(|(play, gap)| *play = Play { half: gap[0], damping: gap[1] });
        other.actuators.iter_mut().zip(lags).for_each(|(actuator, &lag)| actuator.lag = lag);
        other.hidden.iter_mut().zip(rest).for_each(|(hidden, &time)| hidden.time = time);
        if self.is_direct() { Ok(other) } else { other.validated(self.actuators.len(), usize::MAX) }
    }
}

/// What the actuators of a run hold, and what they pass on in the current period.
#[derive(Clone)]
pub struct Line<V> {
    actuators: Vec<Actuator>,
    hidden: Vec<Filling<V>>,
    factors: Vec<f64>,
    /// e^(−dt / 2 time) of each command's lag, then of each hidden state.
    halves: Vec<V>,
    memory: Vec<V>,
    /// Of each command whose effect moves at a limited rate.
    limited: Vec<Option<Limited>>,
    /// Commands on their way, the oldest first, for each command.
    queues: Vec<Vec<V>>,
    /// Effect of each command, then each hidden state, at the start, the middle and the end of the period.
    pub effects: [Vec<V>; 3],
    started: bool,
}

impl<V: Vector> Line<V> {
    /// Actuation at the start of a run, of commands in units of 1 / `factors`, with its times lane by lane.
    pub fn new(actuation: &Actuation, factors: &[f64], dt: f64, times: &[f64]) -> Self {
        let Actuation { actuators, hidden } = actuation;
        let commands = actuators.len();
        // Lane by lane: there is one line a run, and arithmetic on vectors would be compiled for each of them.
        let (decays, gains) = fading(times, dt);
        let (decays, gains): (Vec<V>, Vec<V>) = (vectors(&decays), vectors(&gains));
        let hidden: Vec<_> =
            (commands..).zip(hidden).map_while(|(i, one)| Filling::new(one, decays[i], gains[i])).collect();
        let effects = || zeros(commands + hidden.len());
        Self {
            memory: zeros(commands),
            limited: Limited::those_of(actuation, factors, dt, times, V::LANES),
            effects: [effects(), effects(), effects()],
            queues: actuators.iter().map(|actuator| Vec::with_capacity(actuator.delay + 1)).collect(),
            hidden,
            halves: decays,
            factors: factors.to_vec(),
            actuators: actuators.clone(),
            started: false,
        }
    }

    /// Takes the commands of a period and moves on by it.
    #[inline(always)]
    pub fn pass(&mut self, command: &[V]) {
        for (i, &command) in command.iter().enumerate() {
            let Actuator { delay, rest, .. } = self.actuators[i];
            if !self.started {
                let before = match rest {
                    Some(rest) => V::splat(rest),
                    None => command,
                };
                self.memory[i] = before;
                for _ in 0..delay {
                    self.queues[i].push(before);
                }
            }
            self.queues[i].push(command);
            let arrived = self.queues[i].remove(0);
            let start = self.memory[i];
            let [middle, end] = match &self.limited[i] {
                Some(limited) => limited.halfway_and_through(start, arrived),
                None => {
                    let middle = arrived + (start - arrived) * self.halves[i];
                    [middle, arrived + (middle - arrived) * self.halves[i]]
                }
            };
            self.effects[0][i] = start;
            self.effects[1][i] = middle;
            self.effects[2][i] = end;
            if self.actuators[i].lag == 0.0 && self.actuators[i].ramp == 0.0 {
                self.effects[0][i] = arrived;
            }
            self.memory[i] = end;
        }
        for (place, hidden) in (command.len()..).zip(&mut self.hidden) {
            let values = hidden.pass(command, &self.factors);
            for (effects, value) in self.effects.iter_mut().zip(values) {
                effects[place] = value;
            }
        }
        self.started = true;
    }
}

/// An actuator that moves at a limited rate, for a time; lane by lane, and by a call, for such actuators are rare.
#[derive(Clone)]
struct Limited {
    lags: Vec<f64>,
    /// In units of the command, a second.
    rates: Vec<f64>,
    time: f64,
}

impl Limited {
    /// Of each command, if its effect moves at a limited rate.
    #[inline(never)]
    fn those_of(
        actuation: &Actuation,
        factors: &[f64],
        dt: f64,
        times: &[f64],
        lanes: usize,
    ) -> Vec<Option<Self>> {
        let first = times.len() - actuation.ramping().count() * lanes;
        let mut limited: Vec<_> = actuation.actuators.iter().map(|_| None).collect();
        for (i, ramp) in actuation.ramping().zip(times[first..].chunks_exact(lanes)) {
            let rates = ramp.iter().map(|ramp| 1.0 / (factors[i] * ramp)).collect();
            let lags = times[i * lanes..][..lanes].to_vec();
            limited[i] = Some(Self { lags, rates, time: 0.5 * dt });
        }
        limited
    }

    /// The effect after the time under a command, and after as much again.
    #[inline(never)]
    fn halfway_and_through<V: Vector>(&self, from: V, to: V) -> [V; 2] {
        let (mut effects, mut commands) = ([0.0; 64], [0.0; 64]);
        from.store(&mut effects);
        to.store(&mut commands);
        [(); 2].map(|()| {
            self.advance(&mut effects, &commands);
            V::load(&effects)
        })
    }

    /// Moves the effects on towards the commands.
    #[inline(never)]
    fn advance(&self, effects: &mut [f64], commands: &[f64]) {
        let lanes = self.lags.iter().zip(&self.rates);
        for ((effect, &to), (&lag, &rate)) in effects.iter_mut().zip(commands).zip(lanes) {
            *effect = moved(*effect, to, lag, rate, self.time);
        }
    }
}

/// An effect on its way from a value to a command: it moves at the rate until a lag would be slower.
fn moved(from: f64, to: f64, lag: f64, rate: f64, time: f64) -> f64 {
    let fading = |off: f64, time: f64| if lag > 0.0 { off * libm::exp(-time / lag) } else { 0.0 };
    let beyond = (to - from).abs() - rate * lag;
    if beyond <= 0.0 || beyond.is_nan() {
        return to - fading(to - from, time);
    }
    if beyond >= rate * time {
        return from + (rate * time).copysign(to - from);
    }
    to - fading((rate * lag).copysign(to - from), time - beyond / rate)
}

/// For each time constant: the decay over half a period, e^(−dt / 2 time) or 0 for a time of 0, and the gain of its input.
#[inline(never)]
fn fading(times: &[f64], dt: f64) -> (Vec<f64>, Vec<f64>) {
    let decay = |&time: &f64| if time > 0.0 { libm::exp(-0.5 * dt / time) } else { 0.0 };
    times.iter().map(|time| (decay(time), time * (1.0 - decay(time)))).unzip()
}

/// Effects of recorded commands (n × n_u), then the states that they fill, at the start, the middle and the end of each
/// period (n × (n_u + hidden) each). Every command has its actuator.
pub fn effects(actuation: &Actuation, factors: &[f64], dt: f64, commands: &[f64]) -> [Vec<f64>; 3] {
    use crate::lanes::Scalar;
    let mut line = Line::<Scalar>::new(actuation, factors, dt, &actuation.times());
    let mut out = [vec![], vec![], vec![]];
    for command in commands.chunks_exact(actuation.actuators.len().max(1)) {
        line.pass(&command.iter().map(|&value| Scalar::splat(value)).collect::<Vec<_>>());
        for (out, effects) in out.iter_mut().zip(&line.effects) {
            out.extend(effects.iter().map(|value| value.lane(0)));
        }
    }
    out
}

/// The same of commands (n × n_u) in units of these scales, behind actuation that is checked first; and how many effects
/// a row has.
pub fn checked_effects(
    actuation: Actuation,
    scales: &[f64],
    dt: f64,
    commands: &[f64],
) -> Result<([Vec<f64>; 3], usize)> {
    let n_u = scales.len();
    let positive = |x: f64| x.is_finite() && x > 0.0;
    if n_u == 0 || !commands.len().is_multiple_of(n_u) || !scales.iter().chain([&dt]).all(|&x| positive(x)) {
        return invalid(format!(
            "effects: expected scales of commands and a period above 0, and rows of as many commands, found {scales:?}, \
             {dt} and {} numbers",
            commands.len()
        ));
    }
    let factors: Vec<f64> = scales.iter().map(|scale| 1.0 / scale).collect();
    // Actuators that all act at once are kept: here they only pass commands on.
    let actuators = actuation.actuators.clone();
    let checked = Actuation { actuators, ..actuation.validated(n_u, 0)? };
    let columns = n_u + checked.hidden.len();
    Ok((effects(&checked, &factors, dt, commands), columns))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hidden::Source;

    fn of(actuator: Actuator) -> Actuation {
        Actuation { actuators: vec![actuator], hidden: vec![] }
    }

    #[test]
    fn a_step_rises_as_one_minus_an_exponential() {
        let (lag, dt) = (0.05, 0.02);
        let actuator = Actuator { lag, rest: Some(1.0), ..Actuator::DIRECT };
        let [start, middle, end] = effects(&of(actuator), &[1.0], dt, &[3.0; 20]);
        for k in 0..20 {
            let expected = |t: f64| 3.0 - 2.0 * (-t / lag).exp();
            let t = k as f64 * dt;
            assert!((start[k] - expected(t)).abs() < 1e-12);
            assert!((middle[k] - expected(t + 0.5 * dt)).abs() < 1e-12);
            assert!((end[k] - expected(t + dt)).abs() < 1e-12);
        }
    }

    #[test]
    fn a_delay_shifts_commands_by_whole_periods_and_nothing_is_direct() {
        let commands: Vec<f64> = (0..10).map(f64::from).collect();
        let [start, _, end] =
            effects(&of(Actuator { delay: 3, rest: Some(-1.0), ..Actuator::DIRECT }), &[1.0], 0.1, &commands);
        let expected = [-1.0, -1.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        assert_eq!(start, expected);
        assert_eq!(end, expected);
        let [start, middle, end] = effects(&of(Actuator::DIRECT), &[1.0], 0.1, &commands);
        assert!(start == commands && middle == commands && end == commands);
    }

    #[test]
    fn a_limited_rate_holds_until_the_lag_is_slower() {
        let (lag, rate, scale, dt, fine) = (0.05, 4.0, 2.0, 0.02, 20_000);
        for lag in [lag, 0.0] {
            let actuator = Actuator { lag, rest: Some(0.0), ramp: scale / rate, ..Actuator::DIRECT };
            let commands: Vec<f64> = (0..40).map(|k| if k < 25 { 1.0 } else { -0.6 }).collect();
            let found = effects(&of(actuator), &[1.0 / scale], dt, &commands);
            let (mut state, step) = (0.0, dt / f64::from(fine));
            for (k, command) in commands.iter().enumerate() {
                for (part, found) in found.iter().enumerate() {
                    assert!((found[k] - state).abs() < 1e-4, "{lag} {k} {part}: {} is not {state}", found[k]);
                    for _ in 0..if part < 2 { fine / 2 } else { 0 } {
                        let off: f64 = command - state;
                        let wanted = if lag > 0.0 { off / lag } else { off / step };
                        state += step * wanted.clamp(-rate, rate);
                    }
                }
            }
        }
    }

    #[test]
    fn limited_rates_are_the_last_of_the_times() {
        let hidden =
            Hidden { source: Source::Commands { commands: vec![0], rest: None }, squared: true, time: 2.0 };
        let limited = Actuator { ramp: 0.5, ..Actuator::DIRECT };
        let actuators = vec![Actuator { lag: 0.1, ..Actuator::DIRECT }, limited];
        let actuation = Actuation { actuators, hidden: vec![hidden] }.validated(2, 1).unwrap();
        assert_eq!(actuation.times(), [0.1, 0.0, 2.0, 0.5]);
        let other = actuation.with_times(&[0.2, 0.0, 3.0, 0.25]).unwrap();
        assert_eq!((other.actuators[1].ramp, other.times()), (0.25, vec![0.2, 0.0, 3.0, 0.25]));
        assert!(Actuator { ramp: -1.0, ..Actuator::DIRECT }.validated().is_err());
        assert!(Actuator { ramp: f64::NAN, ..Actuator::DIRECT }.validated().is_err());
    }

    #[test]
    fn a_hidden_state_fills_and_fades_as_its_equation_says() {
        let (time, dt, scale) = (0.3, 0.02, 2.0);
        for squared in [false, true] {
            let source = Source::Commands { commands: vec![0, 1], rest: Some(0.25) };
            let hidden = Hidden { source, squared, time };
            let actuation = Actuation { actuators: vec![Actuator::DIRECT; 2], hidden: vec![hidden] };
            // Ten periods of 3 and 1, then ten at rest.
            let (full, rest): (f64, f64) = if squared { (1.25, 0.5) } else { (1.0, 0.25) };
            let still = scale * if squared { rest } else { 0.25 };
            let commands: Vec<f64> =
                (0..20).flat_map(|k| if k < 10 { [3.0, 1.0] } else { [still, still] }).collect();
            let [start, middle, end] = effects(&actuation, &[1.0 / scale; 2], dt, &commands);
            let exact = |t: f64| {
                let filled = |t: f64| (full - 0.25) * time * (1.0 - (-t / time).exp());
                if t <= 0.2 { filled(t) } else { filled(0.2) * (-(t - 0.2) / time).exp() }
            };
            for k in 0..20 {
                let t = k as f64 * dt;
                assert!((start[3 * k + 2] - exact(t)).abs() < 1e-12);
                assert!((middle[3 * k + 2] - exact(t + 0.5 * dt)).abs() < 1e-12);
                assert!((end[3 * k + 2] - exact(t + dt)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn parts_that_fit_no_commands_are_refused() {
        let hidden = |commands: Vec<usize>, time: f64| Hidden {
            source: Source::Commands { commands, rest: None },
            squared: true,
            time,
        };
        for wrong in
            [hidden(vec![], 1.0), hidden(vec![1], 1.0), hidden(vec![0], 0.0), hidden(vec![0], f64::NAN)]
        {
            let actuation = Actuation { actuators: vec![Actuator::DIRECT], hidden: vec![wrong] };
            assert!(actuation.validated(1, 1).is_err());
        }
        let direct = of(Actuator::DIRECT).validated(1, 1).unwrap();
        assert!(direct.is_direct() && direct.times().is_empty());
        let right = Actuation { actuators: vec![Actuator::DIRECT], hidden: vec![hidden(vec![0], 1.0)] };
        let right = right.validated(1, 1).unwrap();
        assert_eq!(right.with_times(&[0.0, 2.0]).unwrap().times(), [0.0, 2.0]);
        assert!(right.with_times(&[0.0]).is_err());
    }
}
