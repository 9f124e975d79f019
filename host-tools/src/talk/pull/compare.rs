//! Bytes on this PC against a board's log: logs of two cards share names and often lengths.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;

use anyhow::{Context as _, Result};
use hums_blackbox::{Header, Sector, Step};
use hums_link::ftp;

use super::ftp::Ftp;
use crate::logs::board::{heading, known};
use crate::logs::naming::{segment_name, session_name};

const SECTOR: u32 = 512;
/// The box's record comes after at most three sectors of an earlier group.
const HEADING_SECTORS: u32 = 8;

/// Whether the first bytes of a file are those of the box's log, by their checksums.
pub(super) fn is_same(ftp: &mut Ftp, name: &str, path: &Path, bytes: u32) -> Result<bool> {
    if bytes == 0 {
        return Ok(true);
    }
    let theirs = ftp.checksum(name, bytes)?;
    let ours = File::open(path).and_then(|file| checksum(&file, bytes));
    Ok(ours.with_context(|| format!("{}: cannot be read", path.display()))? == theirs)
}

pub(super) struct Heading {
    pub(super) name: String,
    pub(super) session: Option<u32>,
    pub(super) sectors: Vec<Sector>,
}

/// Session and the first sector's number, as far as known.
pub(super) fn beginning_of(head: &[Sector]) -> (Option<u32>, Option<u32>) {
    let headers =
        || (0..).zip(head).filter_map(|(at, sector)| Some((at, Header::read(sector.bytes()).ok()?)));
    let session = headers().next().map(|(_, header)| header.session);
    let is_whole = |header: &Header| Some(header.session) == session && !header.partial;
    let whole = headers().find(|(_, header)| is_whole(header));
    (session, whole.and_then(|(at, header): (u32, _)| header.number.checked_sub(at)))
}

/// The open log's name on this PC. Session by first sectors, box by the record of the start.
pub(super) fn heading_of(ftp: &mut Ftp, name: &str, length: u32) -> Result<Heading> {
    heading_by(name, length, |at| bytes_of(ftp, at, SECTOR))
}

/// The heading of a downloaded file on this PC.
pub(super) fn heading_here(path: &Path, name: &str, length: u32) -> Result<Heading> {
    let unread = || format!("{}: cannot be read", path.display());
    let mut file = File::open(path).with_context(unread)?;
    heading_by(name, length, |at| {
        let mut bytes = vec![0; SECTOR as usize];
        let read = file.seek(SeekFrom::Start(u64::from(at))).and_then(|_| file.read_exact(&mut bytes));
        read.map(|()| bytes).with_context(unread)
    })
}

fn heading_by(name: &str, length: u32, mut sector_at: impl FnMut(u32) -> Result<Vec<u8>>) -> Result<Heading> {
    let mut sectors = Vec::new();
    let Some(segment) = segment_name(Path::new(name)) else {
        return Ok(Heading { name: name.to_owned(), session: None, sectors });
    };
    let (mut session, mut board) = (None, None);
    let mut group = Vec::new();
    for at in (0..HEADING_SECTORS).map(|sector| sector * SECTOR).filter(|at| *at + SECTOR <= length) {
        let bytes = sector_at(at)?;
        let Some(sector) = bytes.first_chunk().map(|bytes| Sector::from_bytes(*bytes)) else { break };
        sectors.push(sector);
        let Ok(header) = Header::read(sector.bytes()) else { continue };
        if *session.get_or_insert(header.session) != header.session {
            continue;
        }
        if header.starts_group() {
            group.clear();
        }
        group.push(Step { header, sector, missing: 0, damaged: 0 });
        board = heading(&group);
        if board.is_some() {
            break;
        }
    }
    let board = board.and_then(known);
    let of = session_name(&format!("{:05}", segment.session), board.as_ref(), session);
    Ok(Heading { name: format!("{of}_{:02}.HUM", segment.segment), session, sectors })
}

/// These bytes of the box's log that is open.
pub(super) fn bytes_of(ftp: &mut Ftp, start: u32, wanted: u32) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    while bytes.len() < wanted as usize {
        let had = bytes.len() as u32;
        bytes.extend(ftp.piece(start + had, wanted - had)?);
    }
    Ok(bytes)
}

fn checksum(file: &File, bytes: u32) -> io::Result<u32> {
    let mut rest = file.take(u64::from(bytes));
    let (mut sum, mut buffer) = (0, vec![0; 64 * 1024]);
    loop {
        match rest.read(&mut buffer)? {
            0 if rest.limit() == 0 => return Ok(sum),
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            count => sum = ftp::checksum(sum, buffer.get(..count).unwrap_or_default()),
        }
    }
}
