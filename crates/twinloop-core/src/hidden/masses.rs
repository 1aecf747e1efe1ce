//! Masses behind gaps, by readings of the rate of what drives them: what presses on each, and its own rate.

use super::Play;

/// A mass behind a gap.
#[derive(Clone, Copy, Debug)]
pub struct Mass {
    /// In which it turns by one radian on what presses, were it fixed on the other side, s.
    pub turns: f64,
    /// The gap, and what damps beyond it.
    pub play: Play,
    /// After which 1/e of its own rate is left, s.
    pub time: f64,
}

/// What presses on a mass, and its rate, at the start, the middle and the end of a period.
pub type Pressed = [[f64; 2]; 3];

impl Mass {
    /// What it does in each period of a run: one Runge-Kutta step of order four, as a law takes it.
    ///
    /// `rates` are those of what drives it at the start, the middle and the end of each period. At the start of the run it
    /// moves along, in the middle of the gap.
    pub fn driven(&self, rates: &[[f64; 3]], dt: f64) -> Vec<Pressed> {
        let (stiffness, fades) = (1.0 / (self.turns * self.turns), 1.0 / self.time);
        let slopes = |twist: f64, rate: f64, driven: f64| {
            let turning = driven - rate;
            let pressed = self.play.press(twist, turning);
            (turning, stiffness * pressed - fades * rate, pressed)
        };
        let mut twist = 0.0;
        let mut rate = rates.first().map_or(0.0, |[first, ..]| *first);
        let period = |&[first, half, last]: &[f64; 3]| {
            let (a, b, at_start) = slopes(twist, rate, first);
            let (c, d, _) = slopes(twist + 0.5 * dt * a, rate + 0.5 * dt * b, half);
            let (e, f, _) = slopes(twist + 0.5 * dt * c, rate + 0.5 * dt * d, half);
            let (g, h, _) = slopes(twist + dt * e, rate + dt * f, last);
            let ended =
                (twist + dt / 6.0 * (a + 2.0 * (c + e) + g), rate + dt / 6.0 * (b + 2.0 * (d + f) + h));
            let (turning, gaining, at_end) = slopes(ended.0, ended.1, last);
            // Hermite's, through both ends.
            let middle = (
                0.5 * (twist + ended.0) + dt / 8.0 * (a - turning),
                0.5 * (rate + ended.1) + dt / 8.0 * (b - gaining),
            );
            let (_, _, midway) = slopes(middle.0, middle.1, half);
            let found = [[at_start, rate], [midway, middle.1], [at_end, ended.1]];
            (twist, rate) = ended;
            found
        };
        rates.iter().map(period).collect()
    }
}
