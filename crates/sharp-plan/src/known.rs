//! What a library knows, made ready for many searches: guided options, their prices, and what hand-overs cost.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;
use sharp_drive::{SuccessEstimate, World};
use sharp_guide::{Goal, GuidedOption, LegId, NoGuide};
use sharp_options::OptionId;
use sharp_sim::NoiseModel;
use sharp_space::Point;

use crate::abstraction::Abstraction;
use crate::hand_over::{HandOver, chain_key, identity};
use crate::library::OptionLibrary;
use crate::method::Method;
use crate::price::{Price, Pricer};
use crate::roster::fingerprint;

/// The options of a library in one building under one method. Making it takes some tens of microseconds an option; a
/// search that is given it finds all of them guided and priced.
#[derive(Debug, Default)]
pub struct KnownOptions {
    guided: BTreeMap<LegId, (Arc<GuidedOption>, Price)>,
    /// Options without a guide.
    unguided: BTreeMap<LegId, NoGuide>,
    hand_overs: BTreeMap<(OptionId, OptionId), SuccessEstimate>,
    /// Seconds that hand-overs cost because the second option fails more often after the first than by itself.
    charges: BTreeMap<(LegId, LegId), f64>,
}

impl KnownOptions {
    /// Those options of `library` that `abstraction` has, and its hand-overs between them. A hand-over counts only for the
    /// guides and policies it was driven with.
    #[must_use]
    pub fn new(
        world: &World,
        abstraction: &Abstraction,
        method: &Method,
        noise: &NoiseModel,
        library: &OptionLibrary,
    ) -> Self {
        let space = abstraction.space(method.search.allowed);
        let pricer = Pricer::new(world, noise, method.search, method.failure_cost_s);
        // Options end at endpoints: this goal belongs to none of them.
        let goal = Goal::new(Point::origin(), world.robot.goal_tolerance_m, world.geometry.clearance());
        let stored: Vec<_> =
            library.iter().filter(|(id, _)| abstraction.options.get(*id).is_some()).collect();
        let guided = stored.par_iter().map(|&(id, stored)| {
            let (leg, ends) = (LegId::Option(id), (id.from(), id.to()));
            let option = GuidedOption::new(&space, leg, ends, stored.guide.clone(), goal.clone());
            let price = pricer.price(&option, None);
            (leg, (Arc::new(option), price))
        });
        let guided = guided.collect();
        let mut this = Self { guided, ..Self::default() };
        let unguided =
            library.building(&fingerprint(&abstraction.options)).map(|building| &building.unguided);
        this.unguided =
            unguided.into_iter().flatten().map(|&id| (LegId::Option(id), NoGuide::Unreachable)).collect();
        let identities: BTreeMap<OptionId, String> = stored
            .iter()
            .map(|&(id, stored)| (id, identity(&stored.corridor, &stored.learnt.policy)))
            .collect();
        for HandOver { before, after, run_up, key, count, mean_time_s } in library.hand_overs() {
            let chain = run_up.iter().chain([before, after]).map(|id| identities.get(id).map(String::as_str));
            let is_current = chain.collect::<Option<Vec<_>>>().is_some_and(|chain| *key == chain_key(&chain));
            if is_current {
                let estimate = SuccessEstimate { count: *count, mean_time_s: *mean_time_s };
                this.hand_overs.insert((*before, *after), estimate);
            }
        }
        this.charges = this.charged(library, method.failure_cost_s);
        this
    }

    /// What an option certainly loses after another, beyond what it loses by itself, is the price of the hand-over.
    fn charged(&self, library: &OptionLibrary, failure_cost_s: f64) -> BTreeMap<(LegId, LegId), f64> {
        let charge = |(&(before, after), pair): (&(OptionId, OptionId), &SuccessEstimate)| {
            let alone = library.get(after)?.learnt.estimate.count;
            let loss = alone.lower95() - pair.count.rate();
            (loss > 0.0).then_some(((LegId::Option(before), LegId::Option(after)), failure_cost_s * loss))
        };
        self.hand_overs.iter().filter_map(charge).collect()
    }

    /// The option called `id` with its guide, or why it has none.
    pub(crate) fn found(&self, id: LegId) -> Option<Result<&Arc<GuidedOption>, &NoGuide>> {
        let unguided = || self.unguided.get(&id).map(Err);
        self.guided.get(&id).map(|(option, _)| Ok(option)).or_else(unguided)
    }

    pub(crate) fn price(&self, id: LegId) -> Option<&Price> {
        self.guided.get(&id).map(|(_, price)| price)
    }

    pub(crate) fn charge(&self, pair: (LegId, LegId)) -> Option<f64> {
        self.charges.get(&pair).copied()
    }

    /// What was measured from the middle of the first option to the middle of the second.
    #[must_use]
    pub fn hand_over(&self, before: OptionId, after: OptionId) -> Option<&SuccessEstimate> {
        self.hand_overs.get(&(before, after))
    }

    /// Options and hand-overs.
    #[must_use]
    pub fn counts(&self) -> (usize, usize) {
        (self.guided.len(), self.hand_overs.len())
    }
}
