//! An onboard log of `ArduPilot`, binary or text, of any content. Reading ends, its times never fall, every row has
//! its table's columns, and the unreadable part is at most the file.

use std::io::Cursor;

use hums::source::dataflash::{self, Form};
use hums::source::input::Input;
use hums::source::item::{Item, Needs, Rows};

/// The first byte chooses: odd is a text log. The rest is the file.
pub fn check(data: &[u8]) {
    let Some((first, log)) = data.split_first() else { return };
    let form = if first % 2 == 1 { Form::Text } else { Form::Binary };
    dataflash::detect(log);
    // Compressed bytes belong to another reader.
    let Ok(input) = Input::new(Cursor::new(log.to_vec())) else { return };
    if log.starts_with(&[0x1f, 0x8b]) {
        return;
    }
    let mut reader = dataflash::open(input, form).expect("nothing is read yet");
    let (mut last, mut unread) = (None, 0);
    let want = Needs { observations: true, rows: Rows::All, ..Needs::default() };
    let summary = reader.read(want, &mut |at, item| {
        assert!(last.is_none_or(|last| last <= at), "time falls from {last:?} to {at:?}");
        last = Some(at);
        match item {
            Item::Row(row) => assert_eq!(row.values.len(), row.table.columns.len(), "{}", row.table.name),
            Item::Gap(gap) => unread += gap.bytes,
            _ => {}
        }
        Ok(())
    });
    let read: u64 =
        summary.expect("damage is no failure").messages.iter().map(|message| message.amount.bytes).sum();
    assert!(read + unread <= log.len() as u64, "{read} bytes read and {unread} not, of {}", log.len());
}

/// A binary log of a few seconds: definitions with units, texts, parameters, and some messages of observations.
pub fn log() -> Vec<u8> {
    let mut out = Vec::new();
    let formats: [(u8, &str, &str, &str); 12] = [
        (128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        (1, "UNIT", "QbZ", "TimeUS,Id,Label"),
        (2, "MULT", "Qbd", "TimeUS,Id,Mult"),
        (3, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
        (4, "MSG", "QZ", "TimeUS,Message"),
        (5, "PARM", "QNff", "TimeUS,Name,Value,Default"),
        (6, "ATT", "Qccc", "TimeUS,Roll,Pitch,Yaw"),
        (7, "GPS", "QBIHBcLLe", "TimeUS,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt"),
        (8, "BAT", "QBfff", "TimeUS,Inst,Volt,Curr,CurrTot"),
        (9, "EV", "QB", "TimeUS,Id"),
        (10, "ISBD", "Qag", "TimeUS,x,h"),
        (11, "MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    ];
    for (kind, name, characters, columns) in formats {
        let length = 3 + characters.bytes().map(size).sum::<usize>() as u8;
        let texts = [padded(name, 4), padded(characters, 16), padded(columns, 64)].concat();
        push(&mut out, 128, &[&[kind, length], &texts]);
    }
    let at = |millis: u64| (millis * 1_000).to_le_bytes();
    push(&mut out, 1, &[&at(1_000), b"s", &padded("s", 64)]);
    push(&mut out, 2, &[&at(1_000), b"F", &1e-6_f64.to_le_bytes()]);
    push(&mut out, 3, &[&at(1_000), &[6], &padded("sddd", 16), &padded("FBBB", 16)]);
    push(&mut out, 4, &[&at(1_000), &padded("ArduCopter V4.6.3 (92b0cd78)", 64)]);
    push(&mut out, 5, &[&at(1_000), &padded("FRAME_CLASS", 16), &[0, 0, 128, 63, 0, 0, 128, 63]]);
    for second in 0..4_u64 {
        let millis = 1_000 + second * 250;
        push(&mut out, 6, &[&at(millis), &[100, 0, 200, 0, 44, 1]]);
        push(&mut out, 7, &[&at(millis), &[3], &[9; 26]]);
        push(&mut out, 8, &[&at(millis), &[0], &12.5_f32.to_le_bytes(), &[0; 8]]);
        push(&mut out, 9, &[&at(millis), &[10 + second as u8]]);
    }
    push(&mut out, 10, &[&at(2_000), &[7; 66]]);
    push(&mut out, 11, &[&at(2_100), &[4, 4, 1]]);
    out
}

/// The same kind of log as text.
pub fn text() -> Vec<u8> {
    b"ArduCopter V3.1\r\n\nFMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\n\
      FMT, 130, 45, GPS, BIHBcLLeeEefI, Status,TimeMS,Week,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs,VZ,T\n\
      FMT, 1, 17, ATT, Iccc, TimeMS,Roll,Pitch,Yaw\nFMT, 3, 6, MODE, Mh, Mode,ThrCrs\n\
      GPS, 3, 109206800, 1774, 9, 2.42, -39.4950300, 176.7483511, 0.05, 46.82, 0.03, 202.77, 0.08, 66937\n\
      ATT, 66940, 0.47, -8.53, 111.24\nMODE, STABILIZE, 350\nATT, 66960, 0.5, -8.5"
        .to_vec()
}

fn size(character: u8) -> usize {
    match character {
        b'b' | b'B' | b'M' => 1,
        b'c' | b'C' | b'h' | b'H' | b'g' => 2,
        b'd' | b'q' | b'Q' => 8,
        b'N' => 16,
        b'Z' | b'a' => 64,
        _ => 4,
    }
}

fn push(out: &mut Vec<u8>, kind: u8, payload: &[&[u8]]) {
    out.extend_from_slice(&[0xa3, 0x95, kind]);
    for bytes in payload {
        out.extend_from_slice(bytes);
    }
}

fn padded(words: &str, length: usize) -> Vec<u8> {
    let mut bytes = words.as_bytes().to_vec();
    bytes.resize(length, 0);
    bytes
}
