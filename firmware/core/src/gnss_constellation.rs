//! A receiver's satellites and its dilution of precision against their baselines in this flight.
//!
//! Both depend on the receiver, on the site and on the view of the antenna, so a site with few satellites is normal.
//! A sudden loss is not: a jammer, a loose cable or a blocked view. It is reported while enough satellites are left.
//! Both figures are followed as logarithms, since the lost part counts.

use crate::latest::Reading;
use crate::observation::Gnss;
use crate::residual::{Comparison, Residuals};
use crate::time::BootMs;

/// The best geometry that counts. Receivers of several systems report less, and then a small change is a large part.
const HDOP_IDEAL: f32 = 1.0;

pub(crate) fn take(residuals: &mut Residuals, at: BootMs, gnss: &Gnss) {
    let fewer = gnss.satellites.filter(|count| *count > 0).map(|count| -libm::logf(count.into()));
    let hdop = gnss.hdop.filter(|hdop| hdop.is_finite()).map(|hdop| libm::logf(hdop.max(HDOP_IDEAL)));
    for (figure, of) in [(fewer, Comparison::SATELLITES), (hdop, Comparison::HDOP)] {
        if let (Some(figure), Some(of), true) = (figure, of.get(usize::from(gnss.instance)), gnss.fix >= 3) {
            residuals.take(*of, at, figure, 0.0);
        }
    }
}

/// The lost part of a receiver's usual satellites, percent.
pub(crate) fn satellites_lost(residuals: &Residuals, now: BootMs, receiver: u8) -> Option<Reading> {
    let reading = residuals.reading(now, *Comparison::SATELLITES.get(usize::from(receiver))?)?;
    Some(Reading { value: (1.0 - libm::expf(-reading.value)) * 100.0, ..reading })
}

/// A receiver's dilution of precision as a multiple of the usual one, 1 at least.
pub(crate) fn hdop_rise(residuals: &Residuals, now: BootMs, receiver: u8) -> Option<Reading> {
    let reading = residuals.reading(now, *Comparison::HDOP.get(usize::from(receiver))?)?;
    Some(Reading { value: libm::expf(reading.value), ..reading })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gates::{self, Gates};

    fn told(said: impl Iterator<Item = (usize, u8, f32)>) -> (Option<f32>, Option<f32>) {
        let (mut residuals, mut now) = (Residuals::default(), BootMs::ZERO);
        residuals.gates = Gates::open(gates::AIRBORNE);
        for (seconds, satellites, hdop) in said {
            for _ in 0..5 * seconds {
                now = now + crate::time::Millis::from_millis(200);
                let fix = if satellites > 0 { 3 } else { 0 };
                let gnss = Gnss { fix, satellites: Some(satellites), hdop: Some(hdop), ..Gnss::default() };
                take(&mut residuals, now, &gnss);
            }
        }
        let tenths = |reading: Reading| (reading.value * 10.0).round() / 10.0;
        (
            satellites_lost(&residuals, now, 0).map(|reading| reading.value.round()),
            hdop_rise(&residuals, now, 0).map(tenths),
        )
    }

    #[test]
    fn a_sudden_loss_is_told_and_a_site_that_has_few_and_a_slow_change_are_usual() {
        for (said, expected) in [
            (&[(60, 16, 0.8), (300, 8, 2.4)][..], (Some(50.0), Some(2.4))),
            (&[(60, 16, 0.8), (300, 8, 2.4), (5, 16, 0.8)], (Some(0.0), Some(1.0))),
            (&[(60, 7, 1.9)], (Some(0.0), Some(1.0))),
            (&[(5, 16, 0.8)], (None, None)),
            (&[(60, 16, 0.5), (1, 0, 0.5)], (Some(0.0), Some(1.0))),
            (&[(60, 30, 0.4), (60, 30, 0.9)], (Some(0.0), Some(1.0))),
        ] {
            assert_eq!(told(said.iter().copied()), expected, "{said:?}");
        }
        let (lost, rise) = told((0..12).map(|step| (40, 20 - step, 1.0 + 0.1 * f32::from(step))));
        assert!(lost.is_some_and(|lost| lost < 20.0) && rise.is_some_and(|rise| rise <= 1.2));
    }
}
