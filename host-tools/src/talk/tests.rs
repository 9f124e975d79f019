//! Finding a board among several.

pub(super) mod fake;

use super::*;
use crate::outcome::Usage;

#[test]
fn of_two_boards_neither_is_taken_unless_it_is_said_which() {
    let listen = Duration::from_millis(20);
    let find = |systems, wanted| {
        let mut client = fake::client(systems, |_| Vec::new());
        client.find(&[COMPONENT], wanted, listen).map(|()| client.target()).context("udpin:0.0.0.0:14550")
    };
    let refused = find(&[2, 1], None).expect_err("which one?");
    let words = format!("{refused:#}");
    assert!(refused.is::<Usage>(), "exit code 2: {words}");
    assert!(words.contains("systems 1, 2") && words.contains("--system N"), "{words}");
    for wanted in [1, 2] {
        assert_eq!(find(&[1, 2], Some(wanted)).expect("it is heard"), (wanted, COMPONENT));
    }
    assert_eq!(find(&[7], None).expect("it is the only one"), (7, COMPONENT));
}

#[test]
fn two_boards_of_one_system_are_told_by_their_unique_ids() {
    let find = |ids: [u8; 2], wanted, listen_ms| {
        let version = move |id: u8| (7, messages::autopilot_version([0, 1, 0], "", &[id; 12]));
        let mut client = fake::client(&[7, 7], move |frame| {
            let asks = frame.id() == 76 && Fields(frame.payload()).u16(28) == REQUEST_MESSAGE;
            if asks { ids.map(version).to_vec() } else { Vec::new() }
        });
        client.find(&[COMPONENT], wanted, Duration::from_millis(listen_ms)).map(|()| client.target())
    };
    for wanted in [None, Some(7)] {
        let refused = find([1, 2], wanted, 50).expect_err("which one?").to_string();
        assert!(refused.starts_with("2 boxes") && refused.contains("as system 7"), "{refused}");
    }
    // One board on two paths. With a system id and no time to wait, the box is taken at once.
    assert_eq!(find([3, 3], None, 50).expect("one box"), (7, COMPONENT));
    assert_eq!(find([1, 2], Some(7), 0).expect("it is taken"), (7, COMPONENT));
}
