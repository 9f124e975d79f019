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

    #[test]
    fn a_vector_is_turned_from_the_axes_of_one_rotation_to_those_of_another() {
        let turned = |wanted: [f32; 3], vector, is: [f32; 3]| {
            from_axes_of(of(wanted.map(f32::to_radians)), vector, &attitude(is))
        };
        let same = [20.0, -35.0, 170.0];
        for (what, one, other) in [
            ("the same attitude", turned(same, [0.3, -1.2, 2.0], same), [0.3, -1.2, 2.0]),
            ("it lags its yaw", turned([0.0, 0.0, 90.0], [0.0, 1.0, 0.5], [0.0; 3]), [-1.0, 0.0, 0.5]),
            (
                "it does not lean",
                turned([30.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]),
                [0.0, -0.5, 0.866_025_4],
            ),
            ("nose down", to_earth(&attitude([0.0, -30.0, 0.0]), [1.0, 0.0, 0.0]), [0.866_025_4, 0.0, 0.5]),
            (
                "right wing down: right is down",
                to_earth(&attitude([90.0, 0.0, 0.0]), [0.0, 1.0, 0.0]),
                [0.0, 0.0, 1.0],
            ),
        ] {
            let is_near = one.iter().zip(other).all(|(one, other)| (one - other).abs() < 1e-5);
            assert!(is_near, "{what}: {one:?} {other:?}");
        }
    }
}
