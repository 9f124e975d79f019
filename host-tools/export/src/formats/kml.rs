//! KML 2.2 for Google Earth.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;
use hums_core::clock::Instant;

use crate::checked::finding_words;
use crate::context::Context;
use crate::format::{Files, Finished, FormatDetails, SingleFile, Totals, Writer};
use crate::journey::{CollectedFindings, Journey, push_element, utc};
use crate::made::OutputFile;
use crate::motion::Fix;
use crate::story::Story;

/// Places of a piece of the track: its times come before its places, so a piece waits in memory.
const PIECE: usize = 512;

const HEAD: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
    <kml xmlns=\"http://www.opengis.net/kml/2.2\" xmlns:gx=\"http://www.google.com/kml/ext/2.2\">\n<Document>\n";
const STYLES: &str = "<Style id=\"track\"><LineStyle><color>ffff9000</color><width>3</width></LineStyle></Style>\n\
    <Style id=\"critical\"><IconStyle><color>ff0000ff</color></IconStyle></Style>\n\
    <Style id=\"warning\"><IconStyle><color>ff00d7ff</color></IconStyle></Style>\n\
    <Style id=\"advisory\"/><Style id=\"stale\"/><Style id=\"ok\"/>\n";

/// The open file.
pub(super) struct Kml {
    file: SingleFile,
    journey: Journey,
    piece: Vec<(Instant, Fix)>,
}

impl Kml {
    fn end_piece(&mut self, context: &Context, goes_on: bool) -> Result<()> {
        let last = self.piece.last().copied();
        if self.piece.len() > 1 {
            self.file.write(piece(context, &self.piece).as_bytes())?;
        }
        self.piece.clear();
        self.piece.extend(last.filter(|_| goes_on));
        Ok(())
    }
}

fn piece(context: &Context, places: &[(Instant, Fix)]) -> String {
    let mut out = String::from("<Placemark><name>track</name><styleUrl>#track</styleUrl>");
    let times: Option<Vec<String>> = places.iter().map(|(at, _)| utc(context, *at)).collect();
    let coordinates = |out: &mut String, separator: char, end: &str| {
        for (_, fix) in places {
            let (longitude, latitude) = (fix.longitude_deg, fix.latitude_deg);
            let _ =
                write!(out, "{longitude:.7}{separator}{latitude:.7}{separator}{:.2}{end}", fix.altitude_m);
        }
    };
    if let Some(times) = times {
        out.push_str("<gx:Track><altitudeMode>absolute</altitudeMode>\n");
        for time in &times {
            push_element(&mut out, "when", time);
        }
        let mut all = String::new();
        coordinates(&mut all, ' ', "\n");
        for place in all.lines() {
            push_element(&mut out, "gx:coord", place);
        }
        out.push_str("</gx:Track>");
    } else {
        out.push_str("<LineString><altitudeMode>absolute</altitudeMode><coordinates>\n");
        coordinates(&mut out, ',', "\n");
        out.push_str("</coordinates></LineString>");
    }
    out + "</Placemark>\n"
}

impl Writer for Kml {
    const ABOUT: FormatDetails = FormatDetails {
        has_observations: true,
        omits: "attitude, battery, motors, texts, parameters: all but the track and findings",
        ..FormatDetails::new(
            "kml",
            "The track with time, findings as placemarks, for Google Earth",
            Files::One("kml"),
        )
    };
    type Encoder = CollectedFindings;

    fn open(context: &Context, path: &Path) -> Result<Self> {
        let mut file = SingleFile::open(context, path)?;
        let mut head = HEAD.to_owned();
        push_element(&mut head, "name", &context.session);
        file.write((head + "\n" + STYLES).as_bytes())?;
        Ok(Self { file, journey: Journey::default(), piece: Vec::new() })
    }

    fn part(&mut self, context: &Context, part: CollectedFindings, story: &Story) -> Result<()> {
        let mut journey = std::mem::take(&mut self.journey);
        let taken = journey.take(context, part, story, |at, fix, begins| {
            if begins {
                self.end_piece(context, false)?;
            }
            self.piece.push((at, fix));
            if self.piece.len() < PIECE { Ok(()) } else { self.end_piece(context, true) }
        });
        self.journey = journey;
        taken
    }

    fn is_empty(&self) -> bool {
        self.journey.fixes == 0
    }

    fn finish(mut self, context: &Context, _: Totals) -> Result<Finished> {
        self.end_piece(context, false)?;
        let mut findings = 0;
        let mut out = String::new();
        for (place, finding) in self.journey.placed() {
            findings += 1;
            out.clear();
            out.push_str("<Placemark>");
            push_element(&mut out, "name", &finding.name());
            push_element(&mut out, "description", &finding_words(finding));
            if let Some(time) = utc(context, finding.at) {
                out.push_str("<TimeStamp>");
                push_element(&mut out, "when", &time);
                out.push_str("</TimeStamp>");
            }
            push_element(&mut out, "styleUrl", &format!("#{}", finding.level.name()));
            let _ = writeln!(
                out,
                "<Point><altitudeMode>absolute</altitudeMode><coordinates>{:.7},{:.7},{:.2}</coordinates></Point></Placemark>",
                place.longitude_deg,
                place.latitude_deg,
                place.height_m.unwrap_or(0.0)
            );
            self.file.write(out.as_bytes())?;
        }
        self.file.write(b"</Document>\n</kml>\n")?;
        let counts = [(self.journey.fixes, "place"), (findings, "finding")];
        let remarks = self.journey.remarks("kml");
        Ok(Finished { made: vec![OutputFile::of(self.file.finish()?, "kml", &counts)], remarks })
    }
}
