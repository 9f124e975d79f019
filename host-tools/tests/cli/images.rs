//! Images of cards: deleted logs, lost names, cut and damaged images.

use std::fs;

use crate::copied::{BLOCK, all_say, copied, readers};
use crate::support::{json, px4, run, stderr, text};

#[test]
fn a_wiped_card_is_told_with_and_without_salvage() {
    let dir = copied(2);
    let path = dir.path().join("card.img");
    let image = fs::read(&path).expect("an image");
    let codes = || -> Vec<i32> {
        let codes = readers(dir.path(), "card.img --salvage").into_iter();
        // A report has no such flag.
        codes.filter(|(command, ..)| !command.starts_with("report")).map(|(_, code, _)| code).collect()
    };
    assert_eq!(codes(), [0; 4]);
    let entry = |name: &[u8]| image.windows(11).position(|bytes| bytes == name).expect("an entry");
    let mut wiped = image.clone();
    for name in [b"00001_00HUM", b"00002_00HUM"] {
        wiped[entry(name)..entry(name) + 32].fill(0);
    }
    fs::write(&path, &wiped).expect("written");
    all_say(dir.path(), "card.img", 3, &[]);
    assert_eq!(codes(), [3; 4]);
}

#[test]
fn a_log_under_another_name_is_read_and_one_that_only_salvage_finds_is_not_called_absent() {
    let dir = copied(3);
    let path = dir.path().join("card.img");
    let image = fs::read(&path).expect("an image");
    let entry = |name: &[u8]| image.windows(11).position(|bytes| bytes == name).expect("an entry");
    let mut renamed = image.clone();
    renamed[entry(b"00003_00HUM")..][..11].copy_from_slice(b"FLIGHT  BAK");
    fs::write(&path, &renamed).expect("written");
    all_say(dir.path(), "card.img", 0, &["FLIGHT.BAK begins as a log and has not the name of a segment"]);
    assert!(text(&run(dir.path(), "info --verify card.img", 0)).contains("Session FLIGHT_BAK (FLIGHT.BAK)"));
    let at = entry(b"00003_00HUM");
    let word = |at: usize| u32::from_le_bytes(image[at..at + 4].try_into().expect("four"));
    let partition = word(446 + 8) as usize * BLOCK;
    let fat = partition + (word(partition + 14) & 0xffff) as usize * BLOCK;
    let free = |image: &mut [u8], entry: usize| {
        let mut next = (word(entry + 26) & 0xffff | word(entry + 20) << 16) as usize;
        while next < 0x0fff_fff8 {
            let following = word(fat + 4 * next) as usize & 0x0fff_ffff;
            image[fat + 4 * next..fat + 4 * next + 4].fill(0);
            next = following;
        }
    };
    let mut taken = image.clone();
    free(&mut taken, at);
    taken[at..at + 11].copy_from_slice(b"NOTES   TXT");
    taken[at + 20..at + 32].fill(0);
    fs::write(&path, &taken).expect("written");
    let words = "sectors that no file names were not looked at: --salvage does";
    for (command, sessions) in [("info", "Session 0000"), ("info --verify", "Session 0000")] {
        let said = text(&run(dir.path(), &format!("{command} card.img"), 0));
        assert!(said.contains(words) && said.matches(sessions).count() == 2, "{command}: {said}");
        let said = text(&run(dir.path(), &format!("{command} card.img --salvage"), 0));
        let counts = ["Session 0000", "Session session-"].map(|sessions| said.matches(sessions).count());
        assert!(!said.contains(words) && counts == [2, 1], "{command}: {said}");
    }
    let told = json(&run(dir.path(), "info --json card.img", 0));
    assert_eq!(told["images"][0]["not_looked_at"], words);
    let mut oldest = image.clone();
    let at = entry(b"00001_00HUM");
    free(&mut oldest, at);
    oldest[at] = 0xe5;
    fs::write(&path, &oldest).expect("written");
    let said = text(&run(dir.path(), "info card.img", 0));
    assert!(said.contains("not looked at, among them those of 1 deleted segment: --salvage does"), "{said}");
}

#[test]
fn a_report_of_the_newest_session_tells_that_an_older_one_on_the_card_is_damaged() {
    let dir = copied(2);
    let path = dir.path().join("card.img");
    let mut image = fs::read(&path).expect("an image");
    let blocks = image.as_chunks_mut::<BLOCK>().0;
    let sectors = blocks.iter_mut().filter(|block| block.starts_with(&[0x48, 0xb3])).skip(20).step_by(8);
    sectors.take(3).for_each(|block| block[100] ^= 4);
    fs::write(&path, image).expect("written");
    for line in ["report card.img -o page.html", "info --verify card.img"] {
        run(dir.path(), line, 3);
    }
    let said = run(dir.path(), "report card.img -o other.html", 3).stderr;
    assert!(String::from_utf8_lossy(&said).contains("00001: 1 gap, "));
}

#[test]
fn a_report_compares_sessions_of_one_card_only() {
    let dir = copied(3);
    let sessions = |line: &str| {
        run(dir.path(), &format!("{line} -o page.html"), 0);
        let page = fs::read_to_string(dir.path().join("page.html")).expect("text");
        fs::remove_file(dir.path().join("page.html")).expect("removed");
        let (_, trend) = page.split_once("\"trend\":{\"sessions\":[").expect("a trend");
        trend.split_once(']').map_or(0, |(sessions, _)| sessions.matches("\"name\"").count())
    };
    assert_eq!((sessions("report card.img"), sessions("report copied")), (2, 2));
    for name in ["one", "two"] {
        run(dir.path(), &format!("decode --format hum PX4 -o {name}.hum"), 0);
    }
    assert_eq!(sessions("report one.hum two.hum"), 1);
}

#[test]
fn an_image_of_a_partition_alone_is_read_like_its_cards() {
    let dir = copied(2);
    let image = fs::read(dir.path().join("card.img")).expect("an image");
    let word = |at: usize| u32::from_le_bytes(image[at..at + 4].try_into().expect("four")) as usize;
    let partition = &image[word(446 + 8) * BLOCK..][..word(446 + 12) * BLOCK];
    fs::create_dir(dir.path().join("part")).expect("made");
    fs::write(dir.path().join("part/card.img"), partition).expect("written");
    for command in ["info --verify", "info", "info --verify --salvage"] {
        let said = |card: &str| text(&run(dir.path(), &format!("{command} {card}"), 0)).replace("part/", "");
        assert_eq!(said("part/card.img"), said("card.img"));
    }
}

#[test]
fn an_image_that_was_cut_short_is_told_as_that() {
    let dir = copied(1);
    let path = dir.path().join("card.img");
    let image = fs::read(&path).expect("an image");
    let half = image.len() / 2;
    fs::write(&path, &image[..half]).expect("written");
    let words = format!("the image is cut short: it has {half} bytes, and its partition ends at byte ");
    for (command, code, said) in readers(dir.path(), "card.img") {
        assert!(code == 3 && said.contains(&words), "{command}: {said}");
        assert!(!said.contains("the card was pulled"), "{command}: {said}");
        assert!(!said.contains("larger than its partition"), "{command}: {said}");
    }
}

#[test]
fn a_damaged_image_in_a_folder_is_read_as_where_it_is_named() {
    let dir = copied(1);
    let cards = dir.path().join("cards");
    fs::create_dir(&cards).expect("a folder");
    let mut image = fs::read(dir.path().join("card.img")).expect("an image");
    image[..512].fill(0);
    fs::write(cards.join("card.img"), &image).expect("written");
    for (command, code, said) in readers(dir.path(), "cards") {
        assert!(code == 3 && !said.contains("no log"), "{command}: {said}");
    }
    let said = text(&run(dir.path(), "info --verify cards", 3));
    assert!(said.ends_with(": all that was found holds; the file system is damaged\n"), "{said}");
    run(dir.path(), "info --verify cards --manifest made.json", 3);
    let made = fs::read(dir.path().join("made.json")).expect("a manifest");
    let made: serde_json::Value = serde_json::from_slice(&made).expect("JSON");
    let card = &made["images"][0];
    assert_eq!((&card["path"], &card["found_by_scan"]), (&"cards/card.img".into(), &true.into()), "{made}");
    assert!(card["damage"].as_array().is_some_and(|damage| !damage.is_empty()), "{made}");
    fs::write(cards.join("card.img"), &image[..300]).expect("written");
    fs::write(cards.join("notes.xyz"), "notes").expect("written");
    fs::copy(px4(), cards.join("flight.tlog")).expect("copied");
    let said = stderr(&run(dir.path(), "check cards", 3));
    assert!(said.contains("has the name of a card's image") && said.contains("notes.xyz"), "{said}");
}
