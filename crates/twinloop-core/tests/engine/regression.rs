//! Regression: whitened inner products, likelihoods and subsets, beside one big normal distribution of all readings.
// Matrices are written as on paper, entry by entry.
#![allow(clippy::needless_range_loop)]

use proptest::prelude::*;
use twinloop_core::{
    Annealing, Chain, Choices, Form, Gram, Noise, Purpose, Record, Stream, Width, Workers, likelihood,
    most_likely_noise, search,
};

use crate::dense::{Matrix, product, solved, transposed, zeros};
use crate::worlds::one_worker;

const FEATURES: usize = 3;

/// One record of a chain, with what the test knows of it.
#[derive(Clone, Debug)]
struct Case {
    chain: Chain,
    noise: Noise,
    measured: Vec<f64>,
    weights: Vec<f64>,
    /// (n × features) at the start, the middle and the end of each period.
    features: [Vec<f64>; 3],
}

impl Case {
    fn record(&self) -> Record {
        let [start, middle, end] = &self.features;
        let (measured, weights) = (self.measured.clone(), self.weights.clone());
        Record::new(&self.chain, FEATURES, measured, weights, [start, middle, end]).unwrap()
    }

    fn steps(&self) -> usize {
        self.measured.len() / self.chain.states - 1
    }

    fn hidden(&self) -> usize {
        usize::from(self.noise.gust > 0.0)
    }

    /// What a period makes of the states, and of a gust behind them.
    fn transition(&self) -> Matrix {
        let (d, dt) = (self.chain.states, self.chain.dt);
        let mut phi = zeros(d + self.hidden(), d + self.hidden());
        for i in 0..d {
            for m in 0..=i {
                phi[i][i - m] = match (self.chain.form, m) {
                    (_, 0) => 1.0,
                    (Form::Acceleration, _) => dt.powi(m as i32) / factorial(m),
                    (Form::ExplicitEuler, 1) => dt,
                    // x + dt (v + dt a).
                    (Form::SemiImplicitEuler, _) => dt.powi(m as i32),
                    _ => 0.0,
                };
            }
            if self.hidden() > 0 {
                phi[i][d] = self.reach(i);
            }
        }
        if self.hidden() > 0 {
            phi[d][d] = (-dt / self.noise.correlation_time).exp();
        }
        phi
    }

    /// How far a disturbance of 1 that is held for a period moves a state.
    fn reach(&self, state: usize) -> f64 {
        let dt = self.chain.dt;
        match (self.chain.form, state) {
            (Form::Acceleration, i) => dt.powi(i as i32 + 1) / factorial(i + 1),
            (Form::SemiImplicitEuler, i) => dt.powi(i as i32 + 1),
            (Form::ExplicitEuler, 0) => dt,
            (_, 0) => 1.0,
            _ => 0.0,
        }
    }

    /// What a period adds to the covariance of the states.
    fn added(&self) -> Matrix {
        let (d, dt) = (self.chain.states, self.chain.dt);
        let mut q = zeros(d + self.hidden(), d + self.hidden());
        for a in 0..d {
            for b in 0..d {
                q[a][b] = match self.chain.form {
                    // ∫ (dt − s)^a / a! (dt − s)^b / b! ds.
                    Form::Acceleration => {
                        let power = a + b + 1;
                        self.noise.process * dt.powi(power as i32)
                            / (factorial(a) * factorial(b) * power as f64)
                    }
                    Form::Absolute | Form::Increment => self.noise.process * self.reach(a) * self.reach(b),
                    // White noise held for a period has a variance of process / dt.
                    _ => self.noise.process / dt * self.reach(a) * self.reach(b),
                };
            }
        }
        if self.hidden() > 0 {
            q[d][d] = self.noise.gust * (1.0 - (-2.0 * dt / self.noise.correlation_time).exp());
        }
        q
    }

    /// Numbers of the readings that count.
    fn counted(&self) -> Vec<usize> {
        (0..self.measured.len()).filter(|&i| self.weights[i] > 0.0).collect()
    }

    /// Covariance of all readings that count, as if there were no law.
    fn covariance(&self) -> Matrix {
        let (d, n) = (self.chain.states, self.steps());
        let (phi, q) = (self.transition(), self.added());
        let mut now = zeros(phi.len(), phi.len());
        for i in 0..d {
            let of_state = self.measured.iter().skip(i).step_by(d);
            now[i][i] = of_state.fold(0.0_f64, |most, x| most.max(x.abs())).powi(2);
        }
        if self.hidden() > 0 {
            now[d][d] = self.noise.gust;
        }
        let mut all = zeros((n + 1) * d, (n + 1) * d);
        for k in 0..=n {
            let mut cross = now.clone();
            for j in k..=n {
                for a in 0..d {
                    for b in 0..d {
                        // State a at j with state b at k.
                        all[j * d + a][k * d + b] = cross[a][b];
                        all[k * d + b][j * d + a] = cross[a][b];
                    }
                }
                cross = product(&phi, &cross);
            }
            for i in 0..d {
                all[k * d + i][k * d + i] += self.noise.sensors[i];
            }
            now = product(&product(&phi, &now), &transposed(&phi));
            now.iter_mut().zip(&q).for_each(|(row, q)| row.iter_mut().zip(q).for_each(|(x, q)| *x += q));
        }
        let counted = self.counted();
        counted.iter().map(|&i| counted.iter().map(|&j| all[i][j]).collect()).collect()
    }

    /// Readings that count (rows) of each feature's own response, and last the readings themselves.
    fn columns(&self) -> Matrix {
        let (d, dt) = (self.chain.states, self.chain.dt);
        let phi = Case { noise: Noise { gust: 0.0, ..self.noise.clone() }, ..self.clone() }.transition();
        let mut columns = vec![];
        for j in 0..FEATURES {
            let (mut state, mut column) = (vec![0.0; d], vec![0.0; d]);
            for k in 0..self.steps() {
                let [start, middle, end] = [0, 1, 2].map(|at| self.features[at][k * FEATURES + j]);
                let mut next: Vec<f64> =
                    phi.iter().map(|row| row.iter().zip(&state).map(|(p, x)| p * x).sum()).collect();
                for (m, next) in next.iter_mut().enumerate() {
                    // Simpson's rule on ∫ (dt − s)^m / m! f(s) ds.
                    *next += if self.chain.form == Form::Acceleration {
                        let weight = |s: f64| (dt - s).powi(m as i32) / factorial(m);
                        dt / 6.0 * (weight(0.0) * start + 4.0 * weight(0.5 * dt) * middle + weight(dt) * end)
                    } else {
                        self.reach(m) * start
                    };
                }
                state = next;
                column.extend(&state);
            }
            columns.push(column);
        }
        columns.push(self.measured.clone());
        self.counted().iter().map(|&i| columns.iter().map(|column| column[i]).collect()).collect()
    }
}

fn factorial(n: usize) -> f64 {
    (1..=n).map(|i| i as f64).product()
}

fn case() -> impl Strategy<Value = Case> {
    (1..4_usize, prop::sample::select(Form::ALL.to_vec()), any::<bool>(), 3..9_usize).prop_flat_map(
        |(states, form, gusts, steps)| {
            let readings = (steps + 1) * states;
            let feature = || prop::collection::vec(-2.0..2.0_f64, steps * FEATURES);
            let noise =
                (prop::collection::vec(1e-3..0.1_f64, states), 1e-2..1.0_f64, 0.1..1.0_f64, 0.05..1.0_f64);
            (
                prop::collection::vec(-2.0..2.0_f64, readings),
                prop::collection::vec(prop::sample::select(vec![1.0, 1.0, 1.0, 0.0]), readings),
                [feature(), feature(), feature()],
                noise,
            )
                .prop_map(
                    move |(measured, weights, features, (sensors, process, gust, correlation_time))| Case {
                        chain: Chain { states, dt: 0.1, form }.validated().unwrap(),
                        noise: Noise {
                            sensors,
                            process,
                            gust: if gusts { gust } else { 0.0 },
                            correlation_time,
                        },
                        measured,
                        weights,
                        features,
                    },
                )
        },
    )
}

/// Walks of an annealing, of which the best one counts.
const WALKS: u64 = 8;

fn near(found: f64, expected: f64, scale: f64) -> bool {
    (found - expected).abs() <= 1e-7 * (scale + expected.abs())
}

/// Whether no feature is nearly a sum of the others.
fn independent(gram: &Gram) -> bool {
    let row = |i: usize| (0..FEATURES).map(|j| gram.product(i, j)).collect::<Vec<_>>();
    let (_, determinant) = solved(&(0..FEATURES).map(row).collect::<Vec<_>>(), &vec![vec![]; FEATURES]);
    determinant.abs() > 1e-6 * (0..FEATURES).map(|i| gram.product(i, i)).product::<f64>()
}

proptest! {
    #[test]
    fn inner_products_are_those_of_one_big_normal_distribution(case in case()) {
        let gram = Gram::new(&case.chain, &[case.record()], FEATURES, &case.noise, &one_worker());
        let columns = case.columns();
        prop_assert_eq!(gram.readings, columns.len());
        let expected = if columns.is_empty() {
            zeros(FEATURES + 1, FEATURES + 1)
        } else {
            product(&transposed(&columns), &solved(&case.covariance(), &columns).0)
        };
        for i in 0..=FEATURES {
            for j in 0..=FEATURES {
                let scale = (expected[i][i] * expected[j][j]).sqrt();
                prop_assert!(near(gram.product(i, j), expected[i][j], scale), "{} {}", gram.product(i, j), expected[i][j]);
            }
        }
    }

    #[test]
    fn an_inner_product_is_the_same_beside_any_others(case in case(), features in 4..80_usize, seed in any::<u64>()) {
        // Columns beyond one vector, and beyond what is multiplied at once.
        let rows = case.steps();
        let mut stream = Stream::new(seed, Purpose::Subsets, 0, 0, 0);
        let columns = [(); 3].map(|()| (0..rows * features).map(|_| stream.gaussian()).collect::<Vec<f64>>());
        let of = |features: usize, columns: &[Vec<f64>; 3], width: Width| {
            let [start, middle, end] = columns;
            let (measured, weights) = (case.measured.clone(), case.weights.clone());
            let record =
                Record::new(&case.chain, features, measured, weights, [start, middle, end]).unwrap();
            Gram::new(&case.chain, &[record], features, &case.noise, &Workers::new(1, width).unwrap())
        };
        let all = of(features, &columns, Width::widest());
        for width in Width::available() {
            let other = of(features, &columns, width);
            for i in 0..=features {
                for j in 0..=features {
                    prop_assert_eq!(all.product(i, j).to_bits(), other.product(i, j).to_bits());
                }
            }
        }
        let chosen = [features - 1, 0, features / 2];
        let few = columns.map(|column| {
            column.chunks(features).flat_map(|row| chosen.map(|j| row[j])).collect::<Vec<f64>>()
        });
        let (alone, part) = (of(3, &few, Width::widest()), all.part(&chosen).unwrap());
        prop_assert_eq!((part.features, part.readings), (3, all.readings));
        for i in 0..=3 {
            for j in 0..=3 {
                prop_assert_eq!(alone.product(i, j).to_bits(), part.product(i, j).to_bits());
            }
        }
        prop_assert!(all.part(&[features]).is_err());
    }

    #[test]
    fn the_likelihood_of_residuals_is_that_of_the_same_distribution(case in case()) {
        let found = likelihood(&case.chain, &[case.record()], std::slice::from_ref(&case.measured), &case.noise);
        let readings: Matrix = case.counted().iter().map(|&i| vec![case.measured[i]]).collect();
        let expected = if readings.is_empty() {
            0.0
        } else {
            let (image, determinant) = solved(&case.covariance(), &readings);
            product(&transposed(&readings), &image)[0][0] + determinant.ln()
        };
        prop_assert!(near(found, expected, 1.0 + readings.len() as f64), "{} {}", found, expected);
    }

    #[test]
    fn least_squares_solve_the_normal_equations(case in case()) {
        let gram = Gram::new(&case.chain, &[case.record()], FEATURES, &case.noise, &one_worker());
        let all: Vec<usize> = (0..FEATURES).collect();
        let Some(found) = gram.solve(&all, 0.0) else { return Ok(()) };
        let rows = |right: &dyn Fn(usize) -> Vec<f64>| -> (Matrix, Matrix) {
            all.iter().map(|&i| (all.iter().map(|&j| gram.product(i, j)).collect::<Vec<_>>(), right(i))).unzip()
        };
        let (matrix, right) = rows(&|i| vec![gram.product(i, FEATURES)]);
        let (expected, _) = solved(&matrix, &right);
        // Where features are collinear, both lose the digits.
        prop_assume!(independent(&gram));
        let identity = |i: usize| (0..FEATURES).map(|j| f64::from(u8::from(i == j))).collect();
        let (inverse, _) = solved(&matrix, &rows(&identity).1);
        for i in 0..FEATURES {
            prop_assert!(near(found.coefficients[i], expected[i][0], 1e-3));
            for j in 0..FEATURES {
                let scale = (inverse[i][i] * inverse[j][j]).sqrt();
                prop_assert!(near(found.covariance()[i * FEATURES + j], inverse[i][j], scale));
            }
        }
        let explained: f64 = (0..FEATURES).map(|i| expected[i][0] * right[i][0]).sum();
        prop_assert!(near(found.chi_squared, gram.total() - explained, gram.total()));
    }

    #[test]
    fn annealing_finds_the_best_of_all_subsets(case in case(), price in 0.1..20.0_f64, seed in any::<u64>()) {
        let gram = Gram::new(&case.chain, &[case.record()], FEATURES, &case.noise, &one_worker());
        // What is nearly collinear annealing does not enter, and what least squares make of it is rounding.
        prop_assume!(independent(&gram));
        let choices = Choices::new(&gram, &[price, 0.5 * price, 2.0 * price]);
        let annealing = Annealing { moves: 400, largest: FEATURES, coldest: 2.0 }.validated().unwrap();
        // One walk may stay behind a subset that is worse than what it has; of several one does not.
        let walks = (0..WALKS).map(|walk| {
            search(&choices, &annealing, &mut Stream::new(seed, Purpose::Subsets, 0, 0, walk), Width::widest())
        });
        let found = walks.min_by(|a, b| a[0].energy.total_cmp(&b[0].energy)).unwrap();
        let energy = |subset: &[usize]| {
            let price: f64 = subset.iter().map(|&j| [price, 0.5 * price, 2.0 * price][j]).sum();
            gram.solve(subset, 0.0).map_or(f64::INFINITY, |solution| solution.chi_squared + price)
        };
        let subsets = (0..1 << FEATURES).map(|set: usize| (0..FEATURES).filter(|j| set >> j & 1 == 1).collect::<Vec<_>>());
        let best = subsets.map(|subset| energy(&subset)).fold(f64::INFINITY, f64::min);
        prop_assert!(near(found[0].energy, best, 1.0), "{:?} {}", found[0], best);
        prop_assert!(near(found[0].energy, energy(&found[0].subset), 1.0));
    }

    #[test]
    fn the_most_likely_noise_is_no_less_likely_than_where_the_search_began(case in case()) {
        let (records, residuals) = ([case.record()], [case.measured.clone()]);
        let smallest = Noise { sensors: vec![1e-6; case.chain.states], process: 1e-9, ..case.noise.clone() };
        let (found, score) = most_likely_noise(&case.chain, &records, &residuals, &case.noise, &smallest);
        prop_assert_eq!(score, likelihood(&case.chain, &records, &residuals, &found));
        // A start that lasts longer than a quarter of the record begins at that.
        let longest = 0.25 * case.chain.dt * (case.measured.len() / case.chain.states) as f64;
        let shorter = case.noise.correlation_time.min(longest.clamp(3.0 * case.chain.dt, 300.0 * case.chain.dt));
        let begun = Noise { correlation_time: shorter, ..case.noise.clone() };
        prop_assert!(score <= likelihood(&case.chain, &records, &residuals, &begun));
        prop_assert!(found.correlation_time <= shorter.max(longest).max(3.0 * case.chain.dt));
        prop_assert!(found.sensors.iter().all(|&sensor| sensor >= 1e-6) && found.process >= 1e-9);
    }
}
