//! `hums due`: what parts have run, and the hours of vehicles.

use std::fs;

use super::support::{flight, json, run, text};

#[test]
fn a_card_says_which_part_is_due_and_what_is_left_of_the_others() {
    let dir = tempfile::tempdir().expect("directory");
    let parts = "CMP1_KIND 1\nCMP1_FLIGHTS 2\nCMP2_KIND 3\nCMP2_NUMBER 3\nCMP2_HOURS 10\nCMP3_KIND 8\n";
    fs::write(dir.path().join("parts.param"), parts).expect("a file");
    let sim = "sim PX4 --sd card.img --store store.bin --params parts.param";
    run(dir.path(), sim, 0);
    let told = text(&run(dir.path(), "due card.img", 0));
    assert!(told.contains("airframe") && told.contains("1 of 2 flights"), "{told}");
    run(dir.path(), sim, 0);
    let told = text(&run(dir.path(), "due card.img", 4));
    let line = |words: &str| told.lines().find(|line| line.contains(words)).expect(words);
    assert!(
        line("2 of 2 flights").starts_with("  DUE ") && line("2 of 2 flights").contains("due now"),
        "{told}"
    );
    assert!(line("motor 3").contains("of 10 h in the air") && line("motor 3").contains(" flights"), "{told}");
    assert!(line("other").contains("no limit"), "{told}");
    let vehicle = json(&run(dir.path(), "due card.img --json", 4))["vehicles"][0].clone();
    assert_eq!((&vehicle["logs"], &vehicle["flights"]), (&2.into(), &2.into()), "{vehicle}");
    let motor = &vehicle["parts"][1];
    let [run_h, left_h, flights] =
        ["run", "left", "left_flights"].map(|name| motor[name].as_f64().expect("a number"));
    assert!((run_h + left_h - 10.0).abs() < 1e-6 && (flights - left_h / run_h * 2.0).abs() < 1.0, "{motor}");
    assert_eq!(motor["rule"], "CMP2_HOURS");
}

#[test]
fn logs_without_an_id_are_of_the_vehicle_of_their_folder_or_of_the_one_that_is_named() {
    let dir = tempfile::tempdir().expect("directory");
    for (folder, name) in
        [("red", "ap_quad_faults.tlog"), ("red", "ap_quad_guided.tlog"), ("blue", "ap_quad_guided.tlog")]
    {
        fs::create_dir_all(dir.path().join(folder)).expect("a folder");
        fs::copy(flight(name), dir.path().join(folder).join(name)).expect("a copy");
    }
    let vehicles = |line: &str| {
        let told = json(&run(dir.path(), line, 0));
        let vehicles = told["vehicles"].as_array().expect("a list").clone();
        let of = |vehicle: &serde_json::Value| {
            let name = vehicle["vehicle"]
                .as_str()
                .expect("a name")
                .rsplit('/')
                .next()
                .unwrap_or_default()
                .to_owned();
            (
                name,
                vehicle["logs"].as_u64().expect("a number"),
                vehicle["flight_s"].as_f64().expect("a number"),
            )
        };
        vehicles.iter().map(of).collect::<Vec<_>>()
    };
    let by_folder = vehicles("due . --json");
    let [(blue, 1, blue_s), (red, 2, red_s)] = by_folder.as_slice() else { panic!("{by_folder:?}") };
    assert_eq!([blue.as_str(), red], ["blue, quadrotor", "red, quadrotor"]);
    assert!((210.0..225.0).contains(blue_s) && (515.0..535.0).contains(red_s), "{by_folder:?}");
    let named = vehicles("due . --json --vehicle mine");
    let [(name, 3, all_s)] = named.as_slice() else { panic!("{named:?}") };
    assert!(name == "mine" && (all_s - blue_s - red_s).abs() < 1e-6, "{named:?}");
}
