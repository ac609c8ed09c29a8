use super::*;

/// A part that takes this share more than the reference.
fn build_work(tool: &str, edge: &str, program: &str, ratio: f64) -> EdgeWork {
    let key = WorkKey {
        reference: WorkReference::Typical,
        tool: tool.to_owned(),
        program: program.to_owned(),
        operation: String::new(),
        work_material: String::new(),
    };
    let mut work = EdgeWork::new(key, edge.to_owned(), 0.3);
    (work.seconds, work.path_mm, work.slide_m) = (100.0, 200.0, 300.0);
    (work.energy_j, work.expected_j) = ((1e5 * ratio, 500.0), (1e5, 0.6e5));
    work
}

/// Parts of an edge that wears by 0.01 mm each, and of a second tool that does not; hardness by part.
fn simulate_parts(follower: &mut WearFollower, edge: &str, count: u32, hardness: &dyn Fn(u32) -> f64) -> Vec<WearNews> {
    let mut news = Vec::new();
    for part in 1..=count {
        let wear = 0.01 * f64::from(part);
        let noise = 1.0 + 0.004 * f64::from(i32::from(part % 2 == 0) * 2 - 1);
        let of = |ratio: f64| ratio * hardness(part) * noise;
        let works = [build_work("T1", edge, "O1", of(0.6 * (1.0 + 0.6 * wear))), build_work("T2", "T2", "O1", of(0.8))];
        news.extend(follower.record_part(&works, 400.0 * f64::from(part)));
    }
    news
}

fn read_outlook(follower: &WearFollower, edge: &str) -> Outlook {
    follower.find_outlook(edge).expect("followed").1
}

#[test]
fn the_wear_of_a_known_new_edge_is_followed_without_a_model() {
    let mut follower = WearFollower::default();
    simulate_parts(&mut follower, "T1", 20, &|_| 1.0);
    simulate_parts(&mut follower, "T1-2", 20, &|_| 1.0);
    let found = read_outlook(&follower, "T1-2");
    assert!((found.wear_mm - 0.2).abs() < 0.03 && found.observed, "{found:?}");
    assert!(found.parts_left[1] <= 10.0 && found.parts_left[2] >= 10.0, "{found:?}");
    assert!(found.worn_probability < 0.1);
    assert!(read_outlook(&follower, "T2").wear_mm < 0.12, "the other tool has not worn");
}

#[test]
fn a_harder_lot_is_no_wear() {
    let mut follower = WearFollower::default();
    simulate_parts(&mut follower, "T1", 20, &|_| 1.0);
    simulate_parts(&mut follower, "T1-2", 12, &|part| if part > 6 { 1.1 } else { 1.0 });
    let found = read_outlook(&follower, "T1-2");
    assert!((found.wear_mm - 0.12).abs() < 0.05 && found.worn_probability < 0.05, "{found:?}");
}

#[test]
fn an_operation_that_the_model_does_not_fit_is_no_wear() {
    let of_the_model = |program: &str, ratio: f64| {
        let mut work = build_work("T1", "T1", program, ratio);
        work.key.reference = WorkReference::Model;
        work
    };
    let mut follower = WearFollower::default();
    for part in 1..=4 {
        follower.record_part(&[of_the_model("O1", 1.02)], 400.0 * f64::from(part));
    }
    let before = read_outlook(&follower, "T1").wear_mm;
    for part in 5..=8 {
        follower.record_part(&[of_the_model("O2", 1.40)], 400.0 * f64::from(part));
    }
    let found = read_outlook(&follower, "T1");
    assert!(found.wear_mm < before + 0.06 && found.worn_probability < 0.05, "{before:.3}, then {found:?}");
}

#[test]
fn a_chipped_edge_is_believed_after_three_parts_and_one_odd_part_is_not() {
    let mut follower = WearFollower::default();
    simulate_parts(&mut follower, "T1", 8, &|_| 1.0);
    let part = |follower: &mut WearFollower, ratio: f64| {
        follower.record_part(&[build_work("T1", "T1", "O1", ratio), build_work("T2", "T2", "O1", 0.8)], 4000.0);
        read_outlook(follower, "T1").worn_probability
    };
    assert!(part(&mut follower, 1.0) < 0.2);
    assert!(part(&mut follower, 0.63) < 0.2);
    let odd: Vec<f64> = (0..4).map(|_| part(&mut follower, 1.0)).collect();
    assert!(odd[1] < 0.2 && odd[3] > 0.5, "{odd:?}");
}

#[test]
fn a_new_edge_that_nobody_announced_is_noticed_and_told() {
    let mut follower = WearFollower::default();
    simulate_parts(&mut follower, "T1", 28, &|_| 1.0);
    let before = read_outlook(&follower, "T1").wear_mm;
    let news = simulate_parts(&mut follower, "T1", 3, &|_| 1.0);
    assert!(news.contains(&WearNews::NewEdge { tool: "T1".to_owned() }), "{news:?}");
    assert!(read_outlook(&follower, "T1").wear_mm < 0.3 * before);
    assert_eq!(follower.edge_number("T1"), Some(2));
}

#[test]
fn the_state_is_stored_and_nothing_odd_gets_in() {
    let mut follower = WearFollower::default();
    simulate_parts(&mut follower, "T1", 5, &|_| 1.0);
    let text = serde_json::to_string(&follower).expect("JSON");
    let back: WearFollower = serde_json::from_str(&text).expect("JSON");
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
    assert!(back.is_sound() && near(read_outlook(&back, "T1").wear_mm, read_outlook(&follower, "T1").wear_mm));
    let mut nothing = build_work("T1", "T1", "O1", f64::NAN);
    assert!(follower.record_part(&[nothing.clone()], 1.0).is_empty());
    nothing.energy_j = (-5.0, 1.0);
    assert!(follower.record_part(&[nothing], 1.0).is_empty());
    for tool in 0..100 {
        let name = format!("T{tool}");
        follower.record_part(&[build_work(&name, &name, &format!("O{tool}"), 0.7)], 1.0);
    }
    assert!(follower.is_sound() && follower.edges.len() <= TOOLS_MAX && follower.groups.len() <= GROUPS_MAX);
}
