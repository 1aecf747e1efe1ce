//! The model loop: evolution of programs judged on the selected tests (paper, section IV.A).

use std::sync::Arc;

use crate::error::{Result, invalid};
use crate::evolution::{Problem, Search, Snapshot, Variation};
use crate::lgp::{Grammar, Learnt, Program};
use crate::model::{Form, Frame, Model, OwnedModel};
use crate::objective::of_model;
use crate::pareto::{crowding_distances, order};
use crate::rng::{Purpose, Stream};
use crate::selected::SelectedTests;
use crate::signals::Signals;
use crate::workers::Workers;

struct Models<'a> {
    grammar: &'a Grammar,
    frame: &'a Frame,
    selected: &'a SelectedTests,
}

impl Problem for Models<'_> {
    type Genome = Learnt;
    const PURPOSES: (Purpose, Purpose) = (Purpose::FirstModels, Purpose::Models);
    const RESAMPLED: bool = false;

    fn objectives(&self) -> usize {
        2 * self.selected.len()
    }

    fn random(&self, stream: &mut Stream) -> Learnt {
        Learnt::new(self.grammar.random(stream))
    }

    fn mutate(&self, parent: &Learnt, stream: &mut Stream) -> Learnt {
        Learnt::new(self.grammar.mutate(&parent.program, stream))
    }

    fn crossover(&self, first: &Learnt, second: &Learnt, stream: &mut Stream) -> Learnt {
        Learnt::new(self.grammar.crossover(&first.program, &second.program, stream).0)
    }

    fn same(&self, child: &Learnt, parent: &Learnt) -> bool {
        child.code == parent.code
    }

    fn judge(&self, genomes: &[Arc<Learnt>], _generation: u64, workers: &Workers) -> Vec<Vec<f64>> {
        workers.map_flights(self.selected.setting().family(), genomes.len(), |i| {
            let model = Model { code: &genomes[i].code, frame: self.frame };
            of_model(model, self.selected, workers.width())
        })
    }
}

/// The model loop as a value.
#[derive(Clone)]
pub struct ModelSearch {
    search: Search<Learnt>,
    grammar: Arc<Grammar>,
    frame: Arc<Frame>,
    signals: Arc<Signals>,
    variation: Variation,
}

impl ModelSearch {
    /// A random population of models, judged on the selected tests.
    pub fn start(
        grammar: Grammar,
        form: Form,
        variation: Variation,
        seed: u64,
        selected: &SelectedTests,
        workers: &Workers,
    ) -> Result<Self> {
        some_test(selected)?;
        let (grammar, variation) = (grammar.validated()?, variation.validated()?);
        let frame = frame(&grammar, form, selected.signals())?;
        let problem = Models { grammar: &grammar, frame: &frame, selected };
        let search = Search::start(&problem, &variation, seed, 1, workers);
        let signals = selected.signals().clone();
        Ok(Self { search, grammar: Arc::new(grammar), frame: Arc::new(frame), signals, variation })
    }

    /// The search that a snapshot was taken of.
    pub fn restored(
        grammar: Grammar,
        form: Form,
        variation: Variation,
        signals: Arc<Signals>,
        snapshot: Snapshot<Learnt>,
        workers: &Workers,
    ) -> Result<Self> {
        let (grammar, variation) = (grammar.validated()?, variation.validated()?);
        let frame = frame(&grammar, form, &signals)?;
        let programs = snapshot.population.iter().chain(&snapshot.members);
        programs.map(|learnt| &learnt.program).try_for_each(|program| grammar.check(program))?;
        if !snapshot.objectives.columns().is_multiple_of(2) {
            return invalid("model search: expected two objectives a test, found an odd number");
        }
        let search = Search::restored(snapshot, &variation, workers)?;
        Ok(Self { search, grammar: Arc::new(grammar), frame: Arc::new(frame), signals, variation })
    }

    /// The same population and non-dominated set, judged on other tests: the next iteration.
    pub fn learn(self, selected: &SelectedTests, workers: &Workers) -> Result<Self> {
        some_test(selected)?;
        if !self.frame.fits(selected.signals()) {
            return invalid(
                "model search: expected tests with the states, commands and period of its models, found others; start a \
                 search for them",
            );
        }
        let problem = Models { grammar: &self.grammar, frame: &self.frame, selected };
        let search = self.search.judged_again(&problem, &self.variation, workers);
        Ok(Self { search, ..self })
    }

    /// The search some generations later.
    pub fn advance(self, selected: &SelectedTests, generations: u64, workers: &Workers) -> Result<Self> {
        if !self.was_judged_on(selected, workers) {
            return invalid(format!(
                "model search: expected the {} tests that it was last judged on, found {}, or others; call learn first",
                self.search.objectives().columns() / 2,
                selected.len()
            ));
        }
        let problem = Models { grammar: &self.grammar, frame: &self.frame, selected };
        let search = self.search.advance(&problem, &self.variation, generations, workers);
        Ok(Self { search, ..self })
    }

    /// Whether the best member gets the row of objectives on these tests that it has.
    fn was_judged_on(&self, selected: &SelectedTests, workers: &Workers) -> bool {
        let (best, archive) = (self.best(), self.search.archive());
        let model = Model { code: &archive.members()[best].code, frame: &self.frame };
        self.search.objectives().columns() == 2 * selected.len()
            && self.frame.fits(selected.signals())
            && of_model(model, selected, workers.width()) == archive.objectives_of(best)
    }

    /// Population, archive and counters.
    pub fn search(&self) -> &Search<Learnt> {
        &self.search
    }

    /// A member of the non-dominated set as a model.
    pub fn model(&self, member: usize) -> OwnedModel {
        let learnt = self.search.archive().members()[member].clone();
        OwnedModel::of(learnt, self.frame.clone(), self.signals.clone())
    }

    /// What makes the programs dynamics.
    pub fn frame(&self) -> &Arc<Frame> {
        &self.frame
    }

    /// The member that is the best trade-off M*.
    pub fn best(&self) -> usize {
        self.search.best(self.variation.distance)
    }

    /// At most `size` members: the best trade-off first, then those with the most room around them.
    pub fn committee(&self, size: usize) -> Vec<usize> {
        let best = self.best();
        let objectives = self.search.archive().objectives();
        let front = vec![0; objectives.len()];
        let spread = order(&front, &crowding_distances(&objectives, &front));
        let others = spread.into_iter().filter(|&member| member != best);
        std::iter::once(best).chain(others).take(size.max(1)).collect()
    }

    /// Mean share of introns over the population, 0 to 1.
    pub fn intron_share(&self) -> f64 {
        let population = self.search.population();
        population.iter().map(|learnt| learnt.program.intron_share()).sum::<f64>() / population.len() as f64
    }
}

/// What makes programs of a grammar dynamics.
fn frame(grammar: &Grammar, form: Form, signals: &Signals) -> Result<Frame> {
    let empty = Program::new(grammar.shape, vec![])?;
    Model::check(&empty, form, signals, 0)?;
    Ok(Frame::new(form, signals))
}

fn some_test(selected: &SelectedTests) -> Result<()> {
    if selected.is_empty() {
        return invalid("model search: expected at least one selected test, found none; tell one first");
    }
    Ok(())
}
