//! Askers, and limits on the changes that they make.

use hums_core::clock::Instant;
use hums_link::request::Port;

use crate::journal::By;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Requester {
    pub(crate) port: Port,
    pub(crate) by: By,
}

const REQUESTS_MAX: u32 = 20;
const REQUESTS_PER_S: u32 = 5;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Limiter {
    left: u32,
    at: Instant,
}

impl Limiter {
    pub(crate) const fn new() -> Self {
        Self { left: REQUESTS_MAX, at: Instant::ZERO }
    }

    pub(crate) fn allows(&mut self, now: Instant) -> bool {
        let gained = now.since(self.at).as_millis() * u64::from(REQUESTS_PER_S) / 1_000;
        if gained > 0 {
            self.left = (u64::from(self.left) + gained).min(u64::from(REQUESTS_MAX)) as u32;
            self.at = now;
        }
        let allows = self.left > 0;
        self.left = self.left.saturating_sub(1);
        allows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_settings_is_cut_to_a_few_a_second() {
        let mut limiter = Limiter::new();
        let allowed = (0..10_000).filter(|now_ms| limiter.allows(Instant::from_millis(*now_ms))).count();
        assert!((60..=75).contains(&allowed), "{allowed} in ten seconds");
    }
}
