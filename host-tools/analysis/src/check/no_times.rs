//! A stopped clock: only the judgement before it remains.

use hums_core::clock::{Instant, Span};

use super::clock::SETTLE;
use super::judged::Judgement;
use crate::source::item::Cause;

/// No check is judged.
const WHY: &str = "the recording has no times";

impl Judgement {
    /// Removes results from there to the next joint, and those of an unknown vehicle.
    pub(super) fn what_is_known(
        self,
        no_times: Option<Instant>,
        joints: &[Instant],
        restarts: &[Instant],
    ) -> Self {
        let Some(from) = no_times else { return self.forget_unheard() };
        let next = joints.iter().copied().find(|joint| *joint > from);
        self.forget(from, next, restarts).forget_unheard()
    }

    fn forget(mut self, from: Instant, to: Option<Instant>, restarts: &[Instant]) -> Self {
        let is_out = |at: Instant| at >= from && to.is_none_or(|to| at < to);
        self.restarts -= restarts.iter().filter(|at| is_out(**at)).count() as u64;
        self.problems.retain(|problem| !is_out(problem.at));
        let findings = self.findings.len();
        self.findings.retain(|finding| !is_out(finding.at));
        self.findings_count -= (findings - self.findings.len()) as u64;
        self.flights.retain(|flight| !is_out(flight.from));
        for flight in self.flights.iter_mut().filter(|flight| flight.from < from && flight.to >= from) {
            (flight.to, flight.landed) = (from, false);
            (flight.disarmed_at_m, flight.mishap) = (None, None);
            flight.air = flight.air.min(from.since(flight.from));
        }
        self.ends_in_air = self.ends_in_air.filter(|end| !is_out(end.at));
        // No known length.
        let (mut damages, mut losses) = (0, 0);
        self.gaps.retain(|gap| {
            let of_time = gap.place.is_none() && matches!(gap.cause, Cause::Lost | Cause::Silent);
            let is_kept = !(of_time && gap.from.is_some_and(is_out));
            damages += u64::from(!is_kept && gap.cause.is_damage());
            losses += u64::from(!is_kept && gap.cause == Cause::Lost);
            is_kept
        });
        (self.damages, self.losses) = (self.damages - damages, self.losses - losses);
        if to.is_none()
            && let Some((first, last)) = self.span
        {
            self.span = Some((first, last.min(from.max(first))));
            self.armed = self.armed.min(from.since(first));
            // The first second is not judged.
            if from <= first + SETTLE {
                self.is_timeless = true;
                (self.armed, self.flights) = (Span::ZERO, Vec::new());
                let judged = std::mem::take(&mut self.judged).into_iter();
                let others = std::mem::take(&mut self.not_judged).into_iter().map(|(check, _)| check);
                self.not_judged = judged.chain(others).map(|check| (check, WHY.to_owned())).collect();
            }
        }
        self
    }

    fn forget_unheard(mut self) -> Self {
        if self.worst().is_none() {
            (self.findings, self.findings_count) = (Vec::new(), 0);
            (self.flights, self.ends_in_air, self.armed) = (Vec::new(), None, Span::ZERO);
        }
        self
    }
}
