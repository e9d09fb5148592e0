//! Trigonometry without calls into the system's mathematical library.
//!
//! Mathematical libraries differ in the last bit from system to system, and one bit is enough to lead an episode
//! elsewhere. These functions give the same bits everywhere and agree with the libraries to 1e-15. Sine, cosine
//! and the direction of a vector are computed here, the rest and rare arguments by `libm`
//! (`docs/decisions/0009-own-trigonometry.md` says why, with times).

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, FRAC_PI_4, PI};

/// Beyond this `libm` reduces the angle better, radians.
const REDUCIBLE_RAD: f64 = 1e5;
/// Added and taken away again, it rounds to the nearest integer.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// A right angle in three parts, the first of which times a small integer is exact.
const RIGHT: [f64; 3] = {
    let first = f64::from_bits(FRAC_PI_2.to_bits() & !0xFFF_FFFF);
    [first, FRAC_PI_2 - first, 6.123_233_995_736_766e-17]
};
/// The arc tangents of 0/8, 1/8, … 8/8.
const ARC_TANGENTS: [f64; 9] = [
    0.0,
    0.124_354_994_546_761_44,
    0.244_978_663_126_864_14,
    0.358_770_670_270_572_25,
    0.463_647_609_000_806_1,
    0.558_599_315_343_562_4,
    0.643_501_108_793_284_4,
    0.718_829_999_621_624_5,
    FRAC_PI_4,
];
/// Lengths between which single precision can compare two of them.
const COMPARABLE: std::ops::Range<f64> = 1e-30..1e30;

/// The sine and the cosine of `angle_rad`.
#[must_use]
#[inline]
pub fn sin_cos(angle_rad: f64) -> (f64, f64) {
    if angle_rad.is_nan() || angle_rad.abs() > REDUCIBLE_RAD {
        return libm::sincos(angle_rad);
    }
    let quarters = (angle_rad * FRAC_2_PI + ROUNDER) - ROUNDER;
    let rest = RIGHT.iter().fold(angle_rad, |rest, part| rest - quarters * part);
    let (sin, cos) = (small_sin(rest), small_cos(rest));
    match quarters as i32 & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// The length of the vector (`x`, `y`): like `f64::hypot`, but from operations that are exact everywhere.
///
/// Accurate to about 1e-16 of the length, as long as the squares of `x` and `y` are normal numbers.
#[must_use]
#[inline]
pub fn hypot(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// The sine of `angle_rad`.
#[must_use]
#[inline]
pub fn sin(angle_rad: f64) -> f64 {
    sin_cos(angle_rad).0
}

/// The cosine of `angle_rad`.
#[must_use]
#[inline]
pub fn cos(angle_rad: f64) -> f64 {
    sin_cos(angle_rad).1
}

/// The tangent of `angle_rad`.
#[must_use]
#[inline]
pub fn tan(angle_rad: f64) -> f64 {
    let (sin, cos) = sin_cos(angle_rad);
    sin / cos
}

/// The direction of the point (`x`, `y`), radians in [−π, π].
#[must_use]
#[inline]
pub fn atan2(y: f64, x: f64) -> f64 {
    let (across, along) = (y.abs(), x.abs());
    let (less, more) = if across > along { (along, across) } else { (across, along) };
    if !(COMPARABLE.contains(&more) && less < COMPARABLE.end) {
        return libm::atan2(y, x);
    }
    // atan(a) = atan(c) + atan((a - c) / (1 + a c)); with c the nearest eighth the rest is at most 1/16.
    let eighths = (8.0 * (less as f32 / more as f32) + 0.5) as usize;
    let c = eighths as f64 / 8.0;
    let octant_rad = ARC_TANGENTS[eighths] + small_atan((less - c * more) / (more + c * less));
    let quadrant_rad = if across > along { FRAC_PI_2 - octant_rad } else { octant_rad };
    (if x < 0.0 { PI - quadrant_rad } else { quadrant_rad }).copysign(y)
}

/// The arc cosine of `cos`, radians in [0, π]; NaN outside of [−1, 1].
#[must_use]
#[inline]
pub fn acos(cos: f64) -> f64 {
    libm::acos(cos)
}

/// The arc tangent of `slope`, radians in [−π/2, π/2].
#[must_use]
#[inline]
pub fn atan(slope: f64) -> f64 {
    libm::atan(slope)
}

/// The sine's Taylor series; on [−π/4, π/4] its next term is below 1e-16.
#[inline]
fn small_sin(x: f64) -> f64 {
    let square = x * x;
    let series = polynomial(
        square,
        [
            -1.0 / 6.0,
            1.0 / 120.0,
            -1.0 / 5_040.0,
            1.0 / 362_880.0,
            -1.0 / 39_916_800.0,
            1.0 / 6_227_020_800.0,
            -1.0 / 1_307_674_368_000.0,
            0.0,
        ],
    );
    x + x * square * series
}

/// The cosine's Taylor series; on [−π/4, π/4] its next term is below 1e-17.
#[inline]
fn small_cos(x: f64) -> f64 {
    let square = x * x;
    let series = polynomial(
        square,
        [
            -0.5,
            1.0 / 24.0,
            -1.0 / 720.0,
            1.0 / 40_320.0,
            -1.0 / 3_628_800.0,
            1.0 / 479_001_600.0,
            -1.0 / 87_178_291_200.0,
            1.0 / 20_922_789_888_000.0,
        ],
    );
    1.0 + square * series
}

/// The arc tangent's Taylor series; on [−1/16, 1/16] its next term is below 1e-18.
#[inline]
fn small_atan(x: f64) -> f64 {
    let square = x * x;
    let series =
        polynomial(square, [-1.0 / 3.0, 1.0 / 5.0, -1.0 / 7.0, 1.0 / 9.0, -1.0 / 11.0, 1.0 / 13.0, 0.0, 0.0]);
    x + x * square * series
}

/// The polynomial with `terms`, lowest first, at `x`: in pairs of pairs (Estrin's scheme), so that the
/// products can be computed side by side.
#[inline]
fn polynomial(x: f64, terms: [f64; 8]) -> f64 {
    let [a, b, c, d, e, f, g, h] = terms;
    let (x2, x4) = (x * x, (x * x) * (x * x));
    ((a + b * x) + (c + d * x) * x2) + ((e + f * x) + (g + h * x) * x2) * x4
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    reason = "the system's library is what these functions are compared with"
)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_agree_with_the_library() {
        for i in -200_000..200_000 {
            let angle_rad = f64::from(i) * 1.234_567e-3;
            let ((sin, cos), expected) = (sin_cos(angle_rad), angle_rad.sin_cos());
            assert!((sin - expected.0).abs() < 1e-15, "sine of {angle_rad}: {sin}, not {}", expected.0);
            assert!((cos - expected.1).abs() < 1e-15, "cosine of {angle_rad}: {cos}, not {}", expected.1);
            let (tangent, expected) = (tan(angle_rad), angle_rad.tan());
            assert!(
                (tangent - expected).abs() < 2e-15 * (1.0 + expected * expected),
                "tangent of {angle_rad}: {tangent}"
            );
        }
    }

    #[test]
    fn directions_agree_with_the_library() {
        for i in 0..100_000 {
            let (sin, cos) = (f64::from(i) * 6.283e-5 - 3.1).sin_cos();
            for scale in [1e-200, 1e-29, 1e-6, 1.0, 1e6, 1e29, 1e200] {
                let (y, x) = (scale * sin, scale * cos);
                assert!((atan2(y, x) - y.atan2(x)).abs() < 1e-15, "direction of ({x}, {y})");
            }
        }
    }

    #[test]
    fn arc_functions_agree_with_the_library() {
        for i in -100_000..=100_000 {
            let cosine = f64::from(i) / 100_000.0;
            assert!((acos(cosine) - cosine.acos()).abs() < 1e-15, "arc cosine of {cosine}");
            let slope = 1e-3 * f64::from(i);
            assert!((atan(slope) - slope.atan()).abs() < 1e-15, "arc tangent of {slope}");
        }
        assert!(acos(1.0 + 1e-9).is_nan() && acos(-2.0).is_nan() && acos(f64::NAN).is_nan());
        assert_eq!((acos(1.0), acos(-1.0)), (0.0, PI));
        assert_eq!((sin(0.3), cos(0.3)), sin_cos(0.3));
    }

    #[test]
    fn zeros_and_nan_agree_with_the_library() {
        for y in [0.0, -0.0, 1.0, -1.0, f64::INFINITY, f64::NAN] {
            for x in [0.0, -0.0, 1.0, -1.0, f64::NEG_INFINITY, f64::NAN] {
                let (found, expected) = (atan2(y, x), y.atan2(x));
                assert!(found == expected || found.is_nan() && expected.is_nan(), "({x}, {y}): {found}");
            }
        }
        assert!(sin_cos(f64::NAN).0.is_nan() && sin_cos(f64::INFINITY).1.is_nan());
        assert_eq!(sin_cos(1e18), libm::sincos(1e18));
    }
}
