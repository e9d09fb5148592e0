//! Another family of options: from each centroid to those two steps away.

use sharp_options::conformance::check_family;
use sharp_options::{
    AllowedRule, Endpoint, EndpointId, OptionFamily, OptionId, OptionKind, OptionSet, OptionSettings,
    OptionSpec,
};
use sharp_rbvd::{Rbvd, RbvdSettings, StateAbstraction, StateId};
use sharp_space::{Cell, DistanceField, OccupancyGrid, Region, RegionId};

/// Options `w:i-k#n`: from the centroid of i to that of k, through the n-th state between them.
#[derive(Debug)]
struct TwoSteps;

impl OptionFamily for TwoSteps {
    fn name(&self) -> &str {
        "two-steps"
    }

    fn synthesize(&self, states: &dyn StateAbstraction, settings: &OptionSettings) -> OptionSet {
        let endpoints = states.states().map(|state| Endpoint::at_centroid(states, state, settings)).collect();
        let mut options = Vec::new();
        let mut crossed = Vec::new();
        for from in states.states() {
            for through in states.neighbors(from) {
                for to in states.neighbors(through).into_iter().filter(|&to| to != from) {
                    let (initiation, termination) = (EndpointId(from.0), EndpointId(to.0));
                    let is_alike = |o: &&OptionSpec| (o.id.from(), o.id.to()) == (from, to);
                    let number = options.iter().filter(is_alike).count() as u32;
                    let id = OptionId::Custom { family: 'w', from, to, number };
                    options.push(OptionSpec { id, initiation, termination });
                    crossed.push((id, through));
                }
            }
        }
        let set = OptionSet::new(OptionKind::Custom, endpoints, options).expect("the options are sound");
        crossed.into_iter().fold(set, |set, (id, through)| {
            set.with_crossed(id, vec![through]).expect("the option is in the set")
        })
    }
}

fn main() {
    let grid = OccupancyGrid::from_ascii(0.5, "###########\n#.........#\n###########").expect("a map");
    let clearance = DistanceField::new(&grid);
    let region = |(id, col)| Region::new(RegionId(id), vec![Cell::new(col, 1)], &clearance);
    let regions: Vec<Region> = [(0, 1), (1, 5), (2, 9)].into_iter().filter_map(region).collect();
    let rbvd = Rbvd::build(&clearance, &regions, &RbvdSettings::default()).expect("a diagram");

    check_family(&TwoSteps, &rbvd, &OptionSettings::default()).expect("a family of options");
    let set = TwoSteps.synthesize(&rbvd, &OptionSettings::default());
    let names: Vec<String> = set.options().iter().map(|option| option.id.to_string()).collect();
    assert_eq!(names, ["w:0-2#0", "w:2-0#0"]);
    assert!(set.allowed_states(&set.options()[0], AllowedRule::Code).any(|state| state == StateId(1)));
    println!("{}", names.join(" "));
}
