//! Texts of our own besides findings: recorded at once, and sent to the ground station when its budget allows.
//!
//! Texts of the protective action and of a mishap are as urgent as a critical finding. The pilot has seconds to
//! cancel an action, and after a mishap the box may have only seconds to send its place.

use core::fmt::{self, Write as _};

use hums_core::clock::{Instant, Span};
use hums_core::mishap::{MishapChange, Report};
use hums_core::protect::{Stage, Step};
use hums_link::messages;
use hums_link::outlet::{Class, Outlet};
use hums_link::packet::Packet;
use hums_link::statustext::{Severity, Text};

const WAITING_MAX: usize = 4;
/// Time that a restart's text waits for a known vehicle.
const UNKNOWN_MAX: Span = Span::from_secs(5);

#[derive(Clone, Copy, Debug)]
pub(crate) enum Notice {
    /// `MAV_SEVERITY` and the text.
    Text(u8, &'static str),
    Protection(Step),
    Mishap(Report),
    Restarted(&'static str, Option<&'static str>),
}

#[derive(Clone, Debug)]
pub(crate) struct Notices(heapless::Vec<Notice, WAITING_MAX>);

impl Notices {
    pub(crate) const fn new() -> Self {
        Self(heapless::Vec::new())
    }

    pub(crate) fn push(&mut self, notice: Notice) {
        let _ = self.0.push(notice);
    }

    /// A text of the protective action or a mishap, before all others.
    pub(crate) fn announce(&mut self, notice: Notice) {
        let Self(notices) = self;
        let is_text = |notice: &Notice| !matches!(notice, Notice::Protection(_) | Notice::Mishap(_));
        if notices.is_full() {
            // Drops a less urgent one, or the oldest: the record has them all.
            notices.remove(if notices.last().is_some_and(is_text) { WAITING_MAX - 1 } else { 0 });
        }
        let place = notices.iter().position(is_text).unwrap_or(notices.len());
        // There is room.
        let _ = notices.insert(place, notice);
    }

    /// As far as the budget allows; our system is unknown before the vehicle is.
    #[inline(never)]
    pub(crate) fn tell(
        &mut self,
        now: Instant,
        is_known: bool,
        outlet: &mut Outlet,
        out: &mut impl FnMut(&[u8]),
    ) {
        while let Some(notice) = self.0.first() {
            // No ground station would show it yet.
            let waits = matches!(notice, Notice::Restarted(..)) && !is_known;
            if waits && now.since(Instant::ZERO) < UNKNOWN_MAX {
                return;
            }
            let (class, packet) = notice.packet();
            if !outlet.send(now, class, &packet, out) {
                return;
            }
            self.0.remove(0);
        }
    }
}

impl Notice {
    fn packet(&self) -> (Class, Packet) {
        match self {
            Self::Text(severity, text) => {
                let severity = if *severity < 5 { Severity::Warning } else { Severity::Notice };
                (Class::Finding, messages::status_text(severity, text))
            }
            Self::Restarted(why, task) => {
                let text = match task {
                    Some(task) => Text::new(format_args!("HUMS: restarted after: {why} ({task})")),
                    None => Text::new(format_args!("HUMS: restarted after: {why}")),
                };
                (Class::Finding, messages::status_text(Severity::Warning, text.as_str()))
            }
            Self::Protection(step) => {
                let (severity, text) = of_protection(step);
                (Class::Critical, messages::status_text(severity, text.as_str()))
            }
            Self::Mishap(report) => {
                let flies = report.change == MishapChange::FliesOn;
                let severity = if flies { Severity::Notice } else { Severity::Critical };
                let text = Text::new(format_args!("HUMS: {}", of_mishap(report).as_str()));
                (Class::Critical, messages::status_text(severity, text.as_str()))
            }
        }
    }
}

fn of_protection(step: &Step) -> (Severity, Text) {
    let (name, detail) = (step.action.name(), step.detail);
    let critical = |text: fmt::Arguments<'_>| (Severity::Critical, Text::new(text));
    let notice = |text: fmt::Arguments<'_>| (Severity::Notice, Text::new(text));
    match step.stage {
        Stage::Announced => critical(format_args!("HUMS: {name} in {detail} s, change mode to cancel")),
        Stage::Counting => critical(format_args!("HUMS: {name} in {detail} s")),
        Stage::CancelledByMode => notice(format_args!("HUMS: {name} cancelled: mode changed")),
        Stage::CancelledOnGround => notice(format_args!("HUMS: {name} cancelled: on the ground")),
        Stage::CancelledByCommand => notice(format_args!("HUMS: {name} cancelled by command")),
        Stage::CancelledClear => notice(format_args!("HUMS: {name} cancelled: ok again")),
        Stage::AlreadyDone => notice(format_args!("HUMS: {name}: already on its way")),
        Stage::Asked => critical(format_args!("HUMS: {name} asked for")),
        Stage::Answered if detail == 0 => notice(format_args!("HUMS: {name} accepted")),
        Stage::Answered => critical(format_args!("HUMS: {name} refused (result {detail})")),
        Stage::Unanswered => critical(format_args!("HUMS: {name}: the autopilot does not answer")),
    }
}

/// Event and place of a mishap, without our name.
pub(crate) fn of_mishap(report: &Report) -> Text {
    let Report { change, place, touch } = report;
    let mut text = Text::default();
    let words = match change {
        MishapChange::Began(_) => "mishap at",
        MishapChange::Down => "down at",
        MishapChange::FliesOn => "mishap over, it flies on",
        MishapChange::FliesAgain => "it flies again, KEEP CLEAR",
        MishapChange::OnBench(kind) => kind.name(),
    };
    let degrees = |e7: i32| {
        let micros = e7 / 10;
        let sign = if micros < 0 { "-" } else { "" };
        (sign, micros.unsigned_abs() / 1_000_000, micros.unsigned_abs() % 1_000_000)
    };
    // Cut where it does not fit, which a test rules out.
    let _ = text.write_str(words);
    if matches!(change, MishapChange::Began(_) | MishapChange::Down) {
        let _ = match place.position {
            Some((latitude, longitude)) => {
                let ((south, lat, lat_e6), (west, lon, lon_e6)) = (degrees(latitude), degrees(longitude));
                write!(text, " {south}{lat}.{lat_e6:06},{west}{lon}.{lon_e6:06}")
            }
            None => text.write_str(" unknown place"),
        };
        let _ = match change {
            MishapChange::Down if *touch == 0 => Ok(()),
            MishapChange::Down => write!(text, " {}.{} m/s", touch / 10, touch % 10),
            _ => write!(text, " {} m", place.height_m),
        };
    }
    text
}

#[cfg(test)]
mod tests {
    use hums_core::mishap::{Location, MishapKind};
    use hums_core::protect::Action;

    use super::*;
    use hums_link::statustext::TEXT_BYTES_MAX;

    #[test]
    fn every_text_of_the_protective_action_fits_with_the_largest_number() {
        for action in [Action::Return, Action::Land] {
            for stage in Stage::ALL {
                let (_, text) = of_protection(&Step { action, stage, detail: 255 });
                let text = text.as_str();
                assert!(text.len() < TEXT_BYTES_MAX && !text.ends_with(':'), "{text}");
            }
        }
    }

    #[test]
    fn every_text_of_a_mishap_fits() {
        let place = |height_m| Location { position: Some((-899_999_999, -1_799_999_999)), height_m };
        let unknown = Location { position: None, height_m: -12_345 };
        let began = MishapChange::Began(MishapKind::Sinking);
        for (change, place, end) in [
            (began, place(-999), " m"),
            (began, place(12_345), " m"),
            (began, unknown, " m"),
            (MishapChange::Down, place(0), "999.9 m/s"),
            (MishapChange::FliesOn, unknown, "flies on"),
            (MishapChange::OnBench(MishapKind::Disarmed), unknown, "disarmed_in_air"),
        ] {
            let text = of_mishap(&Report { change, place, touch: 9_999 });
            let text = text.as_str();
            assert!(text.ends_with(end) && "HUMS: ".len() + text.len() <= TEXT_BYTES_MAX, "{text}");
        }
        let place = Location { position: Some((473_977_420, -85_455_940)), height_m: 30 };
        let report = Report { change: MishapChange::Began(MishapKind::Impact), place, touch: 0 };
        assert_eq!(of_mishap(&report).as_str(), "mishap at 47.397742,-8.545594 30 m");
    }
}
