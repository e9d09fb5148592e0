//! Options on drawn maps, and what holds on every map.

use std::collections::VecDeque;

use expect_test::{Expect, expect};
use sharp_rbvd::{Rbvd, RbvdSettings, StateAbstraction, StateId};
use sharp_space::{Cell, DistanceField, Occupancy, OccupancyGrid, Point, Region, RegionId};

use crate::conformance::{check_family, check_set};
use crate::*;

/// Reads a map, cells of half a metre, on which digits mark the regions 0, 1, … in their order.
fn diagram(drawing: &str) -> Rbvd {
    let plain: String = drawing.chars().map(|c| if c.is_ascii_digit() { '.' } else { c }).collect();
    let grid = OccupancyGrid::from_ascii(0.5, &plain).unwrap();
    let field = DistanceField::new(&grid);
    let rows: Vec<&str> = drawing.lines().map(str::trim).filter(|row| !row.is_empty()).collect();
    let mut marks = Vec::new();
    for (row, line) in rows.iter().rev().enumerate() {
        let digits = line.char_indices().filter_map(|(col, c)| Some((c.to_digit(10)?, Cell::new(col, row))));
        marks.extend(digits);
    }
    marks.sort_unstable();
    let regions = marks
        .chunk_by(|a, b| a.0 == b.0)
        .map(|run| Region::new(RegionId(run[0].0), run.iter().map(|mark| mark.1).collect(), &field).unwrap());
    Rbvd::build(&field, &regions.collect::<Vec<_>>(), &RbvdSettings::default()).unwrap()
}

fn options(rbvd: &Rbvd, kind: OptionKind) -> OptionSet {
    OptionSet::synthesize(rbvd, kind, &OptionSettings::default())
}

fn check(drawing: &str, kind: OptionKind, names: Expect) {
    let set = options(&diagram(drawing), kind);
    let names_of = |options: &[OptionSpec]| {
        options.iter().map(|option| option.id.to_string()).collect::<Vec<_>>().join(" ")
    };
    let lines = (0..set.endpoints().len() as u32).map(EndpointId);
    let lines = lines.map(|id| format!("{:?}: {}\n", set.endpoint(id).site, names_of(set.starting_at(id))));
    names.assert_eq(&lines.collect::<String>());
}

const ROOMS_ON_A_CORRIDOR: &str = "
    ...........
    0....1....2
    ###########";

#[test]
fn centroid_options_join_neighbours_both_ways() {
    check(
        ROOMS_ON_A_CORRIDOR,
        OptionKind::Centroid,
        expect![[r#"
            Centroid(StateId(0)): c:0-1
            Centroid(StateId(1)): c:1-0 c:1-2
            Centroid(StateId(2)): c:2-1
        "#]],
    );
}

#[test]
fn bypass_options_lead_past_a_centroid_between_states_that_are_not_neighbours() {
    let bypasses = |kind| {
        let set = options(&diagram(ROOMS_ON_A_CORRIDOR), kind);
        for option in set.bypasses() {
            assert_eq!(set.get(option.id), Some(option), "found by name");
            assert!(!set.options().contains(option), "{} is not one of the paper's options", option.id);
            assert_eq!(AllowedRule::Code.states(option.id).count(), 3, "{} crosses a state", option.id);
        }
        set.bypasses().iter().map(|option| option.id.to_string()).collect::<Vec<_>>().join(" ")
    };
    assert_eq!(bypasses(OptionKind::Centroid), "c:0-1-2 c:2-1-0");
    assert_eq!(bypasses(OptionKind::Interface), "", "interface options need no bypass");
}

#[test]
fn interface_options_cross_a_state_from_neighbour_to_neighbour() {
    check(
        ROOMS_ON_A_CORRIDOR,
        OptionKind::Interface,
        expect![[r#"
            Interface(PortalId(0)): i:0-1-2
            Interface(PortalId(1)): i:2-1-0
        "#]],
    );
}

#[test]
fn in_a_ring_every_state_is_crossed_both_ways() {
    let ring = "
        .0.......1.
        .#########.
        .#########.
        .....2.....";
    check(
        ring,
        OptionKind::Interface,
        expect![[r#"
            Interface(PortalId(0)): i:1-0-2 i:0-1-2
            Interface(PortalId(1)): i:2-0-1 i:0-2-1
            Interface(PortalId(2)): i:2-1-0 i:1-2-0
        "#]],
    );
}

#[test]
fn two_doors_to_the_same_room_are_told_apart() {
    let rooms = "
        .....#.....
        ...........
        .....#.....
        ..0..#..1..
        .....#.....
        ...........
        .....#.....
        ########.##
        ........2..";
    check(
        rooms,
        OptionKind::Interface,
        expect![[r#"
            Interface(PortalId(0)): i:0-1-2@0.0
            Interface(PortalId(1)): i:0-1-2@1.0
            Interface(PortalId(2)): i:2-1-0@0.0 i:2-1-0@0.1
        "#]],
    );
}

#[test]
fn a_lone_room_has_no_options() {
    for kind in [OptionKind::Centroid, OptionKind::Interface] {
        let set = options(&diagram("...\n.0.\n..."), kind);
        assert_eq!(set.options(), [], "{kind:?}");
    }
}

/// Draws the cells whose centres lie in a set of points.
fn draw(rbvd: &Rbvd, holds: impl Fn(Point) -> bool) -> String {
    let frame = rbvd.frame();
    let symbol = |cell| match (rbvd.state_of(cell), holds(frame.center(cell))) {
        (_, true) => 'x',
        (Some(_), false) => '.',
        (None, false) => '#',
    };
    let rows = (0..frame.height).rev();
    rows.map(|row| (0..frame.width).map(|col| symbol(Cell::new(col, row))).collect::<String>() + "\n")
        .collect()
}

#[test]
fn endpoints_are_balls_within_their_states_that_reach_through_no_wall() {
    let rbvd = diagram(
        "
        ...............
        ...............
        ...0.....1.....
        ...............
        ##############.
        2..............",
    );
    let wide = OptionSettings { endpoint_radius_m: 1.6, ..OptionSettings::default() };
    let set = OptionSet::synthesize(&rbvd, OptionKind::Centroid, &wide);
    let centroid = |state: usize| draw(&rbvd, |point| set.endpoints()[state].contains(point, &rbvd));
    expect![[r#"
        ...............
        ..xxx..........
        ..xxx..........
        ..xxx..........
        ##############.
        ...............
    "#]]
    .assert_eq(&centroid(0));
    assert_eq!(set.endpoints()[0].radius_m, 1.0, "the wall is a metre away");
    assert_eq!(set.endpoints()[2].radius_m, 0.5, "the wall is half a metre away");
    let set = OptionSet::synthesize(&rbvd, OptionKind::Interface, &wide);
    let interface = draw(&rbvd, |point| set.endpoints()[0].contains(point, &rbvd));
    expect![[r#"
        ...............
        .....xxxx......
        .....xxxx......
        .....xxxx......
        ##############.
        ...............
    "#]]
    .assert_eq(&interface);
}

#[test]
fn rules_differ_in_how_much_of_the_outer_states_they_allow() {
    let rbvd = diagram(ROOMS_ON_A_CORRIDOR);
    let set = options(&rbvd, OptionKind::Interface);
    let option = set.get("i:0-1-2".parse().unwrap()).unwrap();
    let allowed = |rule| draw(&rbvd, |point| set.is_allowed(option, rule, point, &rbvd));
    expect![[r#"
        xxxxxxxxxxx
        xxxxxxxxxxx
        ###########

        ...xxxxxxxx
        ..xxxxxxxxx
        ###########

        ...xxxxx...
        ..xxxxxxx..
        ###########
    "#]]
    .assert_eq(&[AllowedRule::Paper, AllowedRule::Code, AllowedRule::Tight].map(allowed).join("\n"));
}

/// A random map of walls with up to six regions of one cell.
fn any_diagram(u: &mut arbtest::arbitrary::Unstructured<'_>) -> arbtest::arbitrary::Result<Option<Rbvd>> {
    let (width, height) = (u.int_in_range(5..=24)?, u.int_in_range(5..=24)?);
    let drawing = vec![".".repeat(width); height].join("\n");
    let mut cells = OccupancyGrid::from_ascii(0.5, &drawing).expect("an empty map is sound").cells().to_vec();
    let frame = *OccupancyGrid::from_ascii(0.5, &drawing).expect("an empty map is sound").frame();
    for _ in 0..u.int_in_range(0..=5)? {
        // A wall from side to side with two doors.
        let (upright, at) = (u.arbitrary::<bool>()?, u.choose_index(width.min(height))?);
        let length = if upright { height } else { width };
        let doors = [u.choose_index(length)?, u.choose_index(length)?];
        for along in (0..length).filter(|along| !doors.contains(along)) {
            let cell = if upright { Cell::new(at, along) } else { Cell::new(along, at) };
            cells[frame.index(cell)] = Occupancy::Occupied;
        }
    }
    let field = DistanceField::new(&OccupancyGrid::new(frame, cells).expect("the frame is sound"));
    let mut regions = Vec::new();
    for id in 0..u.int_in_range(0..=6)? {
        let cell = frame.cell(u.choose_index(frame.len())?);
        regions.extend(Region::new(RegionId(id), vec![cell], &field));
    }
    Ok(Rbvd::build(&field, &regions, &RbvdSettings::default()).ok())
}

/// A sequence of distinct adjacent states from `start` to the state farthest from it.
fn longest_chain(rbvd: &Rbvd, start: StateId) -> Vec<StateId> {
    let mut parents = vec![None; rbvd.len()];
    parents[start.0 as usize] = Some(start);
    let (mut queue, mut last) = (VecDeque::from([start]), start);
    while let Some(state) = queue.pop_front() {
        last = state;
        for &next in rbvd.neighbors(state) {
            if parents[next.0 as usize].is_none() {
                parents[next.0 as usize] = Some(state);
                queue.push_back(next);
            }
        }
    }
    let parent = |state: &StateId| parents[state.0 as usize].filter(|parent| parent != state);
    let mut chain: Vec<StateId> = std::iter::successors(Some(last), parent).collect();
    chain.reverse();
    chain
}

/// The step of Theorem 4.1: along distinct adjacent states there are options with `β_i = I_{i+1}`.
#[test]
fn along_adjacent_states_each_option_ends_where_the_next_starts() {
    arbtest::arbtest(|u| {
        let Some(rbvd) = any_diagram(u)? else { return Ok(()) };
        let chain = longest_chain(&rbvd, StateId(0));
        let set = options(&rbvd, OptionKind::Centroid);
        let by_pair = |pair: &[StateId]| set.get(OptionId::Centroid { from: pair[0], to: pair[1] });
        let centroid: Vec<_> = chain.windows(2).map(|pair| *by_pair(pair).expect("neighbours")).collect();
        assert!(centroid.windows(2).all(|o| o[0].termination == o[1].initiation), "{centroid:?}");

        let set = options(&rbvd, OptionKind::Interface);
        let portals = chain
            .windows(2)
            .map(|pair| EndpointId(rbvd.portals_between(pair[0], pair[1]).next().expect("neighbours").id.0));
        for ends in portals.collect::<Vec<_>>().windows(2) {
            let found = set.starting_at(ends[0]).iter().filter(|option| option.termination == ends[1]);
            assert_eq!(found.count(), 1, "from {:?} to {:?}", ends[0], ends[1]);
        }
        Ok(())
    });
}

#[test]
fn every_family_conforms_on_random_maps() {
    arbtest::arbtest(|u| {
        let Some(rbvd) = any_diagram(u)? else { return Ok(()) };
        let families: [&dyn OptionFamily; 3] = [&CentroidOptions, &InterfaceOptions, &BypassOptions];
        for family in families {
            let checked = check_family(family, &rbvd, &OptionSettings::default());
            assert_eq!(checked, Ok(()), "{}", family.name());
        }
        Ok(())
    });
}

#[test]
fn a_custom_set_is_not_synthesised() {
    let set = options(&diagram(ROOMS_ON_A_CORRIDOR), OptionKind::Custom);
    assert_eq!((set.kind(), set.options(), set.endpoints()), (OptionKind::Custom, &[][..], &[][..]));
}

#[test]
fn bypass_options_are_a_family_too() {
    let rbvd = diagram(ROOMS_ON_A_CORRIDOR);
    let set = BypassOptions.synthesize(&rbvd, &OptionSettings::default());
    assert_eq!(set.options(), options(&rbvd, OptionKind::Centroid).bypasses());
}

#[test]
fn broken_sets_are_refused_with_the_culprit() {
    let rbvd = diagram(ROOMS_ON_A_CORRIDOR);
    let endpoints = options(&rbvd, OptionKind::Centroid).endpoints().to_vec();
    let option = |text: &str, termination| OptionSpec {
        id: text.parse().unwrap(),
        initiation: EndpointId(0),
        termination: EndpointId(termination),
    };
    let refused = |kind, options: &[OptionSpec]| {
        OptionSet::new(kind, endpoints.clone(), options.to_vec()).unwrap_err().to_string()
    };
    let (centroid, own) = (OptionKind::Centroid, option("w:0-1#0", 1));
    assert_eq!(
        refused(centroid, &[option("c:0-1", 7)]),
        "option c:0-1 names endpoint 7, which does not exist"
    );
    assert_eq!(refused(centroid, &[own]), "option w:0-1#0 is no centroid option");
    assert_eq!(refused(OptionKind::Custom, &[own, own]), "option w:0-1#0 occurs twice");
    let id = OptionId::Custom { family: 'C', from: StateId(0), to: StateId(1), number: 0 };
    let message = "family letter is 'C', expected one from a to z but neither c nor i";
    assert_eq!(refused(OptionKind::Custom, &[OptionSpec { id, ..own }]), message);
    let mut flat = endpoints.clone();
    flat[1].radius_m = 0.0;
    let message = "endpoint 1 needs a finite center, a positive radius and at least one state";
    assert_eq!(OptionSet::new(centroid, flat, Vec::new()).unwrap_err().to_string(), message);
    let set = OptionSet::new(OptionKind::Custom, endpoints.clone(), vec![own]).unwrap();
    let unknown = set.with_crossed("w:1-0#0".parse().unwrap(), Vec::new()).unwrap_err();
    assert_eq!(unknown.to_string(), "there is no option w:1-0#0");
}

/// A family that does not share endpoints: its set has a second one at the first centroid.
#[derive(Debug)]
struct Doubled;

impl OptionFamily for Doubled {
    fn name(&self) -> &str {
        "doubled"
    }

    fn synthesize(&self, states: &dyn StateAbstraction, settings: &OptionSettings) -> OptionSet {
        let set = CentroidOptions.synthesize(states, settings);
        let (mut endpoints, mut options) = (set.endpoints().to_vec(), set.options().to_vec());
        endpoints.push(endpoints[0].clone());
        options[0].initiation = EndpointId(endpoints.len() as u32 - 1);
        OptionSet::new(OptionKind::Centroid, endpoints, options).expect("the parts are sound")
    }
}

#[test]
fn the_conformance_check_finds_what_is_wrong() {
    let rbvd = diagram(ROOMS_ON_A_CORRIDOR);
    let found = check_family(&Doubled, &rbvd, &OptionSettings::default()).unwrap_err().to_string();
    assert_eq!(found, "endpoints 0 and 3 both lie at Centroid(StateId(0)), so they are not shared");
    let spoilt = |spoil: &dyn Fn(&mut Vec<Endpoint>, &mut Vec<OptionSpec>)| {
        let set = options(&rbvd, OptionKind::Centroid);
        let (mut endpoints, mut options) = (set.endpoints().to_vec(), set.options().to_vec());
        spoil(&mut endpoints, &mut options);
        let set = OptionSet::new(OptionKind::Centroid, endpoints, options).unwrap();
        check_set(&set, &rbvd).unwrap_err().to_string()
    };
    let count = rbvd.len() as u32;
    let message = format!("endpoint 1 names state {count}, which does not exist");
    assert_eq!(spoilt(&|endpoints, _| endpoints[1].states = vec![StateId(count)]), message, "one too many");
    let message = "endpoint 1 does not contain its own center";
    assert_eq!(spoilt(&|endpoints, _| endpoints[1].states = vec![StateId(0)]), message);
    let message = "option c:0-1 leaves state 0 but begins at endpoint 2, which does not touch it";
    assert_eq!(spoilt(&|_, options| options[0].initiation = EndpointId(2)), message);
    let message = "option c:0-1 enters state 1 but ends at endpoint 2, which does not touch it";
    assert_eq!(spoilt(&|_, options| options[0].termination = EndpointId(2)), message);
}

#[test]
fn options_have_unique_names_and_endpoints_that_hold_their_centers() {
    arbtest::arbtest(|u| {
        let Some(rbvd) = any_diagram(u)? else { return Ok(()) };
        for kind in [OptionKind::Centroid, OptionKind::Interface] {
            let set = options(&rbvd, kind);
            for option in set.options() {
                assert_eq!(set.get(option.id), Some(option), "found by name");
                assert_eq!(option.id.to_string().parse(), Ok(option.id), "survives text");
                assert_eq!(option.id.kind(), kind, "{}", option.id);
                assert!(set.successors(option).iter().all(|next| next.initiation == option.termination));
                for id in [option.initiation, option.termination] {
                    let endpoint = set.endpoint(id);
                    assert!(endpoint.contains(endpoint.center, &rbvd), "{endpoint:?} lacks its center");
                    assert!((0.2..=0.4).contains(&endpoint.radius_m), "{endpoint:?}");
                    for rule in [AllowedRule::Paper, AllowedRule::Code, AllowedRule::Tight] {
                        assert!(
                            set.is_allowed(option, rule, endpoint.center, &rbvd),
                            "{rule:?} {endpoint:?}"
                        );
                    }
                }
                let touches = |id, state| set.endpoints_in(state).any(|found| found == id);
                assert!(touches(option.initiation, option.id.from()), "{option:?} does not start there");
                assert!(touches(option.termination, option.id.to()), "{option:?} does not end there");
            }
        }
        Ok(())
    });
}
