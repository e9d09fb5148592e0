//! How long does the guide of one option take: 4 to 10 m in a furnished 15 m map, cells of 0.067 m?

use criterion::{Criterion, criterion_group, criterion_main};
use sharp_guide::{
    ClearanceSearch, GuideEnd, GuidePlanner, GuideRequest, GuideRobot, LearnAndLink, Steering,
};
use sharp_maps::{FloorplanKind, generate};
use sharp_space::{Footprint, FootprintChecker, Point, Seed};

fn requests(checker: &FootprintChecker) -> Vec<(GuideEnd, GuideEnd)> {
    let field = checker.field();
    let roomy: Vec<Point> = (0..field.frame().len())
        .step_by(997)
        .map(|index| field.frame().cell(index))
        .filter(|&cell| field.at(cell) > 0.7)
        .map(|cell| field.frame().center(cell))
        .collect();
    let end = |position: &Point| GuideEnd { position: *position, heading: None };
    let all = roomy.iter().flat_map(|a| roomy.iter().map(move |b| (a, b)));
    all.filter(|(a, b)| (4.0..10.0).contains(&(*a - *b).norm()))
        .map(|(a, b)| (end(a), end(b)))
        .take(40)
        .collect()
}

fn bench(c: &mut Criterion) {
    let grid = generate(FloorplanKind::FurnishedRooms, 15.0, 0.067, &mut Seed(5).stream("map", 0));
    let husky = Footprint::rectangle(0.5, 0.335).expect("sound");
    let limo = Footprint::rectangle(0.161, 0.11).expect("sound");
    let (search, link) = (&ClearanceSearch::default(), &LearnAndLink::default());
    let cases: [(&str, Footprint, Steering, &dyn GuidePlanner); 3] = [
        ("guide_search/husky", husky, Steering::RotateTranslate, search),
        ("guide_search/limo", limo, Steering::Dubins { radius_m: 0.4 }, search),
        ("guide_learn_and_link/husky", husky, Steering::RotateTranslate, link),
    ];
    for (name, footprint, steering, planner) in cases {
        let checker = FootprintChecker::new(&grid, footprint);
        let robot = GuideRobot::new(&checker, steering);
        let requests = requests(&checker);
        let plan = |i: usize| {
            let (start, goal) = requests[i % requests.len()];
            let request = GuideRequest { start, goal, allowed: &|_| true };
            planner.plan(&request, &robot, &mut Seed(1).stream("guide", i as u64))
        };
        let planned = (0..requests.len()).filter(|&i| plan(i).is_ok()).count();
        assert!(planned * 10 >= requests.len() * 8, "{name}: {planned} of {} guides", requests.len());
        let mut i = 0;
        c.bench_function(name, |b| {
            b.iter(|| {
                i += 1;
                plan(i)
            });
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(std::time::Duration::from_millis(300))
        .measurement_time(std::time::Duration::from_secs(2));
    targets = bench
}
criterion_main!(benches);
