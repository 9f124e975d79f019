//! GPX 1.1: the track with time, a waypoint for each finding.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;

use crate::checked::finding_words;
use crate::context::Context;
use crate::format::{Files, Finished, FormatDetails, SingleFile, Spool, Totals, Writer};
use crate::journey::{CollectedFindings, Journey, push_element, utc};
use crate::made::OutputFile;
use crate::story::Story;

/// Waypoints come before the track, and some are known last.
pub(super) struct Gpx {
    file: SingleFile,
    track: Spool,
    journey: Journey,
}

impl Writer for Gpx {
    const ABOUT: FormatDetails = FormatDetails {
        has_observations: true,
        omits: "attitude, battery, motors, texts, parameters: all but the track and findings",
        ..FormatDetails::new("gpx", "The track with time, findings as waypoints, for maps", Files::One("gpx"))
    };
    type Encoder = CollectedFindings;

    fn open(context: &Context, path: &Path) -> Result<Self> {
        Ok(Self { file: SingleFile::open(context, path)?, track: Spool::new()?, journey: Journey::default() })
    }

    fn part(&mut self, context: &Context, part: CollectedFindings, story: &Story) -> Result<()> {
        let mut out = String::new();
        let track = &mut self.track;
        self.journey.take(context, part, story, |at, fix, begins| {
            out.clear();
            if begins {
                out.push_str("</trkseg><trkseg>\n");
            }
            let _ = write!(
                out,
                "<trkpt lat=\"{:.7}\" lon=\"{:.7}\"><ele>{:.2}</ele>",
                fix.latitude_deg, fix.longitude_deg, fix.altitude_m
            );
            if let Some(time) = utc(context, at) {
                push_element(&mut out, "time", &time);
            }
            out.push_str("</trkpt>\n");
            track.write(out.as_bytes())
        })
    }

    fn is_empty(&self) -> bool {
        self.journey.fixes == 0
    }

    fn finish(mut self, context: &Context, _: Totals) -> Result<Finished> {
        let mut out = String::from(concat!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n",
            "<gpx version=\"1.1\" creator=\"hums ",
            env!("CARGO_PKG_VERSION"),
            "\" xmlns=\"http://www.topografix.com/GPX/1/1\">\n"
        ));
        self.file.write(out.as_bytes())?;
        let mut findings = 0;
        for (place, finding) in self.journey.placed() {
            findings += 1;
            out.clear();
            let _ = write!(
                out,
                "<wpt lat=\"{:.7}\" lon=\"{:.7}\"><ele>{:.2}</ele>",
                place.latitude_deg,
                place.longitude_deg,
                place.height_m.unwrap_or(0.0)
            );
            if let Some(time) = utc(context, finding.at) {
                push_element(&mut out, "time", &time);
            }
            push_element(&mut out, "name", &finding.name());
            push_element(&mut out, "desc", &finding_words(finding));
            push_element(&mut out, "type", finding.level.name());
            out.push_str("</wpt>\n");
            self.file.write(out.as_bytes())?;
        }
        out.clear();
        out.push_str("<trk>");
        push_element(&mut out, "name", &context.session);
        out.push_str("<trkseg>\n");
        self.file.write(out.as_bytes())?;
        self.track.copy(&mut self.file)?;
        self.file.write(b"</trkseg></trk>\n</gpx>\n")?;
        let counts = [(self.journey.fixes, "place"), (findings, "finding")];
        let remarks = self.journey.remarks("gpx");
        Ok(Finished { made: vec![OutputFile::of(self.file.finish()?, "gpx", &counts)], remarks })
    }
}
