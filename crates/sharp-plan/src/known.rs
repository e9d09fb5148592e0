//! What a library knows, made ready for many searches: guided options, their prices, and what hand-overs cost.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use sharp_drive::{SuccessEstimate, World};
use sharp_guide::{Goal, GuidedOption, LegId, NoGuide};
use sharp_options::OptionId;
use sharp_space::Point;

use crate::abstraction::Abstraction;
use crate::hand_over::{HandOver, Identities, chain_key};
use crate::library::OptionLibrary;
use crate::method::Method;
use crate::price::{Price, Pricer};
use crate::repair::ENTERED_MIN;
use crate::roster::fingerprint;

/// The options of a library in one building under one method. A search that is given it finds all of them guided, and
/// those priced that an earlier search has asked for.
#[derive(Debug, Default)]
pub struct KnownOptions {
    guided: BTreeMap<LegId, KnownOption>,
    /// Options without a guide.
    unguided: BTreeMap<LegId, NoGuide>,
    hand_overs: BTreeMap<(OptionId, OptionId), SuccessEstimate>,
    /// Seconds that hand-overs cost because the second option fails more often after the first than by itself.
    charges: BTreeMap<(LegId, LegId), f64>,
}

#[derive(Debug)]
struct KnownOption {
    option: Arc<GuidedOption>,
    /// Asked for by a few of the options of a large building only.
    price: OnceLock<Price>,
}

impl KnownOptions {
    /// Those options of `library` that `abstraction` has, and its hand-overs between them. A hand-over counts only for the
    /// guides and policies it was driven with.
    #[must_use]
    pub fn new(world: &World, abstraction: &Abstraction, method: &Method, library: &OptionLibrary) -> Self {
        let space = abstraction.space(method.search.allowed);
        // Options end at endpoints: this goal belongs to none of them.
        let goal = Goal::new(Point::origin(), world.robot.goal_tolerance_m, world.geometry.clearance());
        let stored: Vec<_> =
            library.iter().filter(|(id, _)| abstraction.options.get(*id).is_some()).collect();
        let guided = stored.par_iter().map(|&(id, stored)| {
            let (leg, ends) = (LegId::Option(id), (id.from(), id.to()));
            let option = GuidedOption::new(&space, leg, ends, stored.guide.clone(), goal.clone());
            (leg, KnownOption { option: Arc::new(option), price: OnceLock::new() })
        });
        let guided = guided.collect();
        let mut this = Self { guided, ..Self::default() };
        let unguided =
            library.building(&fingerprint(&abstraction.options)).map(|building| &building.unguided);
        this.unguided =
            unguided.into_iter().flatten().map(|&id| (LegId::Option(id), NoGuide::Unreachable)).collect();
        let mut hashed = Identities::default();
        let identities: BTreeMap<OptionId, String> = stored
            .iter()
            .map(|&(id, stored)| (id, hashed.of(&stored.corridor, &stored.learnt.policy)))
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
            let is_known = pair.count.episodes >= ENTERED_MIN;
            (is_known && loss > 0.0)
                .then_some(((LegId::Option(before), LegId::Option(after)), failure_cost_s * loss))
        };
        self.hand_overs.iter().filter_map(charge).collect()
    }

    /// The option called `id` with its guide, or why it has none.
    pub(crate) fn found(&self, id: LegId) -> Option<Result<&Arc<GuidedOption>, &NoGuide>> {
        let unguided = || self.unguided.get(&id).map(Err);
        self.guided.get(&id).map(|known| Ok(&known.option)).or_else(unguided)
    }

    /// The price of the option called `id`. The first one asked for is kept, so `pricer` must have the settings of the method
    /// that this was made for.
    pub(crate) fn price(&self, id: LegId, pricer: &Pricer<'_>) -> Option<&Price> {
        let known = self.guided.get(&id)?;
        Some(known.price.get_or_init(|| pricer.price(&known.option, None)))
    }

    pub(crate) fn charge(&self, pair: (LegId, LegId)) -> Option<f64> {
        self.charges.get(&pair).copied()
    }

    /// What was measured from the middle of the first option to the middle of the second.
    #[must_use]
    pub fn hand_over(&self, before: OptionId, after: OptionId) -> Option<&SuccessEstimate> {
        self.hand_overs.get(&(before, after))
    }
}
