//! Rotations, as quaternions from the body's axes (forward, right, down) to north, east, down: real part first.

use crate::observation::Attitude;

fn turn([w, x, y, z]: [f32; 4], vector: [f32; 3]) -> [f32; 3] {
    let cross = |[a, b, c]: [f32; 3]| [y * c - z * b, z * a - x * c, x * b - y * a];
    let once = cross(vector).map(|part| 2.0 * part);
    let twice = cross(once);
    [0, 1, 2].map(|axis| vector[axis] + w * once[axis] + twice[axis])
}

fn of([roll, pitch, yaw]: [f32; 3]) -> [f32; 4] {
    let [(sr, cr), (sp, cp), (sy, cy)] =
        [roll, pitch, yaw].map(|angle| (libm::sinf(angle / 2.0), libm::cosf(angle / 2.0)));
    [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
}

/// A vector about the axes of another rotation, about those of an attitude.
pub(crate) fn from_axes_of(other: [f32; 4], vector: [f32; 3], attitude: &Attitude) -> [f32; 3] {
    let [w, x, y, z] = of([attitude.roll.0, attitude.pitch.0, attitude.yaw.0]);
    turn([w, -x, -y, -z], turn(other, vector))
}

pub(crate) fn to_earth(attitude: &Attitude, vector: [f32; 3]) -> [f32; 3] {
    turn(of([attitude.roll.0, attitude.pitch.0, attitude.yaw.0]), vector)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Radians;

    fn attitude(degrees: [f32; 3]) -> Attitude {
        let [roll, pitch, yaw] = degrees.map(|degrees| Radians(degrees.to_radians()));
        Attitude { roll, pitch, yaw, ..Attitude::default() }
    }

    #[track_caller]
    fn is_near(one: [f32; 3], other: [f32; 3]) {
        assert!(one.iter().zip(other).all(|(one, other)| (one - other).abs() < 1e-5), "{one:?} {other:?}");
    }

    #[test]
    fn the_axes_of_the_same_attitude_are_the_same() {
        let angles = [20.0, -35.0, 170.0];
        let same = of(angles.map(f32::to_radians));
        is_near(from_axes_of(same, [0.3, -1.2, 2.0], &attitude(angles)), [0.3, -1.2, 2.0]);
    }

    #[test]
    fn a_vehicle_that_lags_its_yaw_rolls_as_the_other_one_pitches() {
        let wanted = of([0.0, 0.0, 90_f32.to_radians()]);
        is_near(from_axes_of(wanted, [0.0, 1.0, 0.5], &attitude([0.0; 3])), [-1.0, 0.0, 0.5]);
    }

    #[test]
    fn a_yaw_of_what_is_to_lean_and_does_not_is_a_pitch_too() {
        let wanted = of([30_f32.to_radians(), 0.0, 0.0]);
        is_near(from_axes_of(wanted, [0.0, 0.0, 1.0], &attitude([0.0; 3])), [0.0, -0.5, 0.866_025_4]);
    }

    #[test]
    fn angles_and_quaternions_are_of_the_same_rotation() {
        is_near(turn(of([0.0, -30_f32.to_radians(), 0.0]), [1.0, 0.0, 0.0]), [0.866_025_4, 0.0, 0.5]);
        // Right wing down: right is down.
        is_near(turn(of([90_f32.to_radians(), 0.0, 0.0]), [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
    }
}
