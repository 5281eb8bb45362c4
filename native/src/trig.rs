//! Sine and cosine of the six joints of a pose at once.
//!
//! The reduction by parts of pi / 2 and the polynomials are those of fdlibm (Sun
//! Microsystems, 1993), good to one unit in the last place; without branches, so that
//! the compiler does several angles side by side.

const FAR: f64 = 1e5; // [rad] beyond which the reduction is left to the system's library
const TWO_OVER_PI: f64 = std::f64::consts::FRAC_2_PI;
/// Added and taken away again, it rounds to the nearest integer, ties to even.
const ROUNDING: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52
const HALF_PI: [f64; 3] =
    [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_7e-21];
const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_007e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Return sines and cosines.
#[inline(always)]
pub fn sin_cos<const N: usize>(angles: &[f64; N]) -> ([f64; N], [f64; N]) {
    let (mut sin, mut cos) = ([0.0; N], [0.0; N]);
    if angles.iter().fold(false, |far, x| far | (x.abs() > FAR)) {
        for j in 0..N {
            (sin[j], cos[j]) = angles[j].sin_cos();
        }
        return (sin, cos);
    }
    for j in 0..N {
        let shifted = angles[j] * TWO_OVER_PI + ROUNDING;
        let quarters = shifted - ROUNDING;
        let x = HALF_PI.iter().fold(angles[j], |x, part| x - quarters * part);
        let z = x * x;
        let tail = z * SIN.iter().rev().fold(0.0, |sum, c| sum * z + c);
        let s = x + x * tail;
        let half = 0.5 * z;
        let near = 1.0 - half;
        let tail = z * z * COS.iter().rev().fold(0.0, |sum, c| sum * z + c);
        let c = near + ((1.0 - near - half) + tail);
        let quarter = shifted.to_bits();
        let odd = (quarter & 1).wrapping_neg();
        let (s, c) = (s.to_bits(), c.to_bits());
        let (a, b) = ((s & !odd) | (c & odd), (c & !odd) | (s & odd));
        sin[j] = f64::from_bits(a ^ ((quarter & 2) << 62));
        cos[j] = f64::from_bits(b ^ ((quarter.wrapping_add(1) & 2) << 62));
    }
    (sin, cos)
}

#[cfg(test)]
mod tests {
    use super::sin_cos;
    use crate::rows::Six;

    #[test]
    fn is_as_good_as_the_system_library() {
        let mut x = -40.0;
        while x < 40.0 {
            let angles: Six = std::array::from_fn(|j| x + 0.11 * j as f64);
            let (sin, cos) = sin_cos(&angles);
            for j in 0..6 {
                let (s, c) = angles[j].sin_cos();
                assert!((sin[j] - s).abs() < 2.3e-16 && (cos[j] - c).abs() < 2.3e-16);
            }
            x += 0.001_37;
        }
    }

    #[test]
    fn knows_the_quarters_and_what_is_no_angle() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let angles: Six = std::array::from_fn(|j| quarter * (j as f64 - 2.0));
        let (sin, cos) = sin_cos(&angles);
        for j in 0..6 {
            let (s, c) = angles[j].sin_cos();
            assert!((sin[j] - s).abs() < 1e-30 && (cos[j] - c).abs() < 1e-30);
        }
        let (sin, cos) = sin_cos(&[f64::NAN, 0.0, f64::INFINITY, 1e9, -1e300, 1.0]);
        assert!(sin[0].is_nan() && cos[0].is_nan() && sin[2].is_nan());
        assert_eq!((sin[1], cos[1], sin[3], cos[4]), (0.0, 1.0, 1e9_f64.sin(), 1e300_f64.cos()));
    }
}
