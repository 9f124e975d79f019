//! A log of ours whose recorder ran no checks (`hums pack`) is checked when it is read: "not checked" is not "good".

use anyhow::Result;

use super::judge::{Judge, Limits};
use crate::logs::Log;
use crate::source::item::Want;
use crate::source::recording::{Format, Place};
use crate::summary::{FindingLine, Overview};

/// Reads a log through; where nobody has checked it, the monitor here does.
pub fn overview(log: &Log) -> Result<Overview> {
    let mut overview = Overview::of(log)?;
    if overview.contents.is_checked() || overview.contents.frames() == 0 {
        return Ok(overview);
    }
    let mut judge = Judge::new(&Limits::default(), Format::Tlog);
    let place = Place::log(log.name.clone(), log.clone());
    place.open()?.read(Want { observations: true, ..Want::default() }, &mut |at, item| {
        judge.item(at, item);
        Ok(())
    })?;
    let judged = judge.end();
    let contents = &mut overview.contents;
    contents.findings_count = judged.findings_count;
    contents.findings = judged.findings.into_iter().map(FindingLine::from).collect();
    contents.checked_here = true;
    Ok(overview)
}
