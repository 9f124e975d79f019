//! Which estimator's figures are the vehicle's.

use std::fmt::Write as _;

use hums_core::observation::Observation;

use super::seen;

fn figures(uses: u8) -> usize {
    let mut log = "ArduPlane V3.1.2beta1 (834f90e8)\n\
        FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
        FMT, 129, 23, PARM, Nf, Name,Value\n\
        FMT, 163, 30, EKF4, IcccccccbbBB, TimeMS,SV,SP,SH,SMX,SMY,SMZ,SVT,OFN,OFE,FS,DS\n"
        .to_owned();
    let _ = writeln!(log, "PARM, AHRS_EKF_USE, {uses}");
    for second in 1..10 {
        let _ =
            writeln!(log, "EKF4, {}, 2.10, 0.90, 0.10, 1.30, 0.06, 0.00, 0.00, 0, 0, 0, 0", second * 1_000);
    }
    let is_figure = |seen: &Observation| matches!(seen, Observation::Estimator(_)).then_some(());
    seen(log.as_bytes()).find(is_figure).len()
}

#[test]
fn a_filter_that_runs_beside_what_the_vehicle_flies_by_says_nothing_of_the_vehicle() {
    assert_eq!((figures(0), figures(1)), (0, 9));
}
