//! Everything in order, an object a line.

use std::path::Path;

use anyhow::Result;
use hums_core::clock::Instant;

use crate::context::Context;
use crate::format::{Entry, Files, Finished, FormatDetails, GroupEncoder, SingleFile, Totals, Writer};
use crate::hex::push_hex;
use crate::made::OutputFile;
use crate::names::message_name;
use crate::row::Row;
use crate::story::Story;
use crate::text::{push_integer, push_json_object, push_json_text};
use crate::utc::{push_iso8601, push_seconds};

/// The open file.
pub(super) struct Jsonl {
    file: SingleFile,
    objects: u64,
}

#[derive(Default)]
pub(super) struct Lines(Vec<u8>);

impl GroupEncoder for Lines {
    fn frame(&mut self, _: &Context, entry: &Entry<'_>) {
        let Entry { frame, known, .. } = entry;
        let out = &mut self.0;
        push_times(out, entry.at, entry.utc_us);
        for (name, number) in
            [(&b",\"system\":"[..], frame.system()), (b",\"component\":", frame.component())]
        {
            out.extend_from_slice(name);
            push_integer(out, u64::from(number));
        }
        out.extend_from_slice(b",\"id\":");
        push_integer(out, u64::from(frame.id()));
        out.extend_from_slice(b",\"message\":");
        push_json_text(out, message_name(frame.id()).as_bytes());
        if let Some(payload) = known {
            out.extend_from_slice(b",\"fields\":");
            push_json_object(out, payload);
        } else {
            out.extend_from_slice(b",\"verified\":false,\"payload\":\"");
            push_hex(out, frame.payload());
            out.push(b'"');
        }
        out.extend_from_slice(b"}\n");
    }

    fn row(&mut self, context: &Context, at: Instant, row: &Row) {
        let out = &mut self.0;
        push_times(out, at, context.epochs.utc_us(at));
        out.extend_from_slice(b",\"record\":");
        push_json_text(out, row.table.as_bytes());
        out.extend_from_slice(b",\"fields\":");
        row.push_json_object(out);
        out.extend_from_slice(b"}\n");
    }

    fn held_bytes(&self) -> usize {
        self.0.len()
    }
}

impl Writer for Jsonl {
    const ABOUT: FormatDetails = FormatDetails::new(
        "jsonl",
        "An object a line, in order of time, for scripts and log stores",
        Files::One("jsonl"),
    );
    type Encoder = Lines;

    fn open(context: &Context, path: &Path) -> Result<Self> {
        Ok(Self { file: SingleFile::open(context, path)?, objects: 0 })
    }

    fn part(&mut self, _: &Context, part: Lines, _: &Story) -> Result<()> {
        self.objects += memchr::memchr_iter(b'\n', &part.0).count() as u64;
        self.file.write(&part.0)
    }

    fn finish(self, _: &Context, _: Totals) -> Result<Finished> {
        Ok(OutputFile::of(self.file.finish()?, "jsonl", &[(self.objects, "object")]).into())
    }
}

fn push_times(out: &mut Vec<u8>, at: Instant, utc_us: Option<u64>) {
    out.extend_from_slice(b"{\"time_boot\":");
    push_seconds(out, at.as_micros());
    out.extend_from_slice(b",\"time_utc\":");
    match utc_us {
        Some(utc_us) => {
            out.push(b'"');
            push_iso8601(out, utc_us);
            out.push(b'"');
        }
        None => out.extend_from_slice(b"null"),
    }
}
