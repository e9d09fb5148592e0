//! Shortest forward curves of bounded curvature (Dubins 1957), by the six words of Shkel and Lumelsky,
//! "Classification of the Dubins set", 2001.

use std::f64::consts::TAU;

use sharp_space::{Pose, trig};

use crate::maneuver::Primitive;

/// The three pieces of the shortest word from `from` to `to` with turning radius `radius_m` > 0.
///
/// Ties go to the word that comes first in LSL, RSR, LSR, RSL, RLR, LRL.
pub(crate) fn shortest(from: Pose, to: Pose, radius_m: f64) -> [Primitive; 3] {
    debug_assert!(radius_m > 0.0, "turning radius is {radius_m} m, must be positive");
    let local = from.to_local(to.position) / radius_m;
    let bearing = trig::atan2(local.y, local.x);
    let problem = DubinsProblem::new(
        local.norm(),
        positive_angle(-bearing),
        positive_angle(from.heading.turn_to(to.heading) - bearing),
    );
    let words = [problem.lsl(), problem.rsr(), problem.lsr(), problem.rsl(), problem.rlr(), problem.lrl()];
    let shortest = words.into_iter().flatten().reduce(|best, word| {
        // Two words of equal length differ by rounding only; the first one must win all the same.
        if length(&word) < length(&best) - 1e-9 { word } else { best }
    });
    shortest
        .expect("LSL exists for every pair of poses")
        .map(|(side, size)| Primitive { travel_m: size * radius_m, turn_rad: side * size })
}

/// Side (+1 left, 0 straight, −1 right) and size (radians, or radii for a straight) of each piece.
type DubinsWord = [(f64, f64); 3];

const LEFT: f64 = 1.0;
const STRAIGHT: f64 = 0.0;
const RIGHT: f64 = -1.0;

fn length(word: &DubinsWord) -> f64 {
    word.iter().map(|(_, size)| size).sum()
}

/// The angle in [0, 2π). An angle just below a full turn counts as zero, because rounding would otherwise add
/// a loop.
fn positive_angle(angle_rad: f64) -> f64 {
    let angle = angle_rad.rem_euclid(TAU);
    if TAU - angle < 1e-8 { 0.0 } else { angle }
}

/// Both poses in the frame whose x axis points from one to the other, lengths in turning radii.
struct DubinsProblem {
    d: f64,
    alpha: f64,
    beta: f64,
    sin_a: f64,
    sin_b: f64,
    cos_a: f64,
    cos_b: f64,
    cos_ab: f64,
}

impl DubinsProblem {
    fn new(d: f64, alpha: f64, beta: f64) -> Self {
        let ((sin_a, cos_a), (sin_b, cos_b)) = (trig::sin_cos(alpha), trig::sin_cos(beta));
        Self { d, alpha, beta, sin_a, sin_b, cos_a, cos_b, cos_ab: trig::cos(alpha - beta) }
    }

    fn lsl(&self) -> Option<DubinsWord> {
        let x = self.d + self.sin_a - self.sin_b;
        let (p, angle) = self.straight(x, self.cos_b - self.cos_a);
        Some(word(
            [LEFT, STRAIGHT, LEFT],
            positive_angle(angle - self.alpha),
            p,
            positive_angle(self.beta - angle),
        ))
    }

    fn rsr(&self) -> Option<DubinsWord> {
        let x = self.d - self.sin_a + self.sin_b;
        let (p, angle) = self.straight(x, self.cos_a - self.cos_b);
        Some(word(
            [RIGHT, STRAIGHT, RIGHT],
            positive_angle(self.alpha - angle),
            p,
            positive_angle(angle - self.beta),
        ))
    }

    fn lsr(&self) -> Option<DubinsWord> {
        let x = self.d + self.sin_a + self.sin_b;
        let squared = self.d * self.d - 2.0 + 2.0 * self.cos_ab + 2.0 * self.d * (self.sin_a + self.sin_b);
        let p = (squared >= 0.0).then(|| squared.sqrt())?;
        let angle = trig::atan2(-self.cos_a - self.cos_b, x) - trig::atan2(-2.0, p);
        Some(word(
            [LEFT, STRAIGHT, RIGHT],
            positive_angle(angle - self.alpha),
            p,
            positive_angle(angle - self.beta),
        ))
    }

    fn rsl(&self) -> Option<DubinsWord> {
        let x = self.d - self.sin_a - self.sin_b;
        let squared = self.d * self.d - 2.0 + 2.0 * self.cos_ab - 2.0 * self.d * (self.sin_a + self.sin_b);
        let p = (squared >= 0.0).then(|| squared.sqrt())?;
        let angle = trig::atan2(self.cos_a + self.cos_b, x) - trig::atan2(2.0, p);
        Some(word(
            [RIGHT, STRAIGHT, LEFT],
            positive_angle(self.alpha - angle),
            p,
            positive_angle(self.beta - angle),
        ))
    }

    fn rlr(&self) -> Option<DubinsWord> {
        let x = self.d - self.sin_a + self.sin_b;
        let p = self.middle_turn(self.sin_a - self.sin_b)?;
        let t = positive_angle(self.alpha - trig::atan2(self.cos_a - self.cos_b, x) + p / 2.0);
        Some(word([RIGHT, LEFT, RIGHT], t, p, positive_angle(self.alpha - self.beta - t + p)))
    }

    fn lrl(&self) -> Option<DubinsWord> {
        let x = self.d + self.sin_a - self.sin_b;
        let p = self.middle_turn(self.sin_b - self.sin_a)?;
        let t = positive_angle(-self.alpha - trig::atan2(self.cos_a - self.cos_b, x) + p / 2.0);
        Some(word([LEFT, RIGHT, LEFT], t, p, positive_angle(self.beta - self.alpha - t + p)))
    }

    /// Length and direction of the straight between two circles on the same side.
    ///
    /// If the straight has no length, its direction is rounding noise. Then the last arc makes the whole
    /// turn.
    fn straight(&self, x: f64, y: f64) -> (f64, f64) {
        let p = trig::hypot(x, y);
        if p > 1e-7 { (p, trig::atan2(y, x)) } else { (0.0, self.alpha) }
    }

    /// The long turn between two equal ones. `None` if the outer circles are too far apart.
    fn middle_turn(&self, sin_difference: f64) -> Option<f64> {
        let cos = (6.0 - self.d * self.d + 2.0 * self.cos_ab + 2.0 * self.d * sin_difference) / 8.0;
        (cos.abs() <= 1.0).then(|| positive_angle(TAU - trig::acos(cos)))
    }
}

fn word(sides: [f64; 3], t: f64, p: f64, q: f64) -> DubinsWord {
    [(sides[0], t), (sides[1], p), (sides[2], q)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn end(from: Pose, pieces: &[Primitive; 3]) -> Pose {
        pieces.iter().fold(from, |pose, piece| piece.advance(pose, 1.0))
    }

    #[test]
    fn every_word_ends_at_the_goal() {
        arbtest::arbtest(|u| {
            let mut real = |max: i32| u.int_in_range(-max..=max).map(|i| f64::from(i) / 1000.0);
            let from = Pose::new(real(3000)?, real(3000)?, real(3142)?);
            let to = Pose::new(real(3000)?, real(3000)?, real(3142)?);
            let pieces = shortest(from, to, 0.4);
            let reached = end(from, &pieces);
            assert!(reached.distance_m(&to) < 1e-6, "{from:?} to {to:?} ended at {reached:?}");
            assert!(reached.heading.turn_to(to.heading).abs() < 1e-6, "{from:?} to {to:?}: {reached:?}");
            Ok(())
        });
    }

    #[test]
    fn known_lengths() {
        let pi = std::f64::consts::PI;
        for (to, expected) in [
            (Pose::new(3.0, 0.0, 0.0), 3.0),
            (Pose::new(0.0, 2.0, pi), pi),
            (Pose::new(1.0, 1.0, pi / 2.0), pi / 2.0),
            (Pose::new(0.0, 0.0, 0.0), 0.0),
        ] {
            let pieces = shortest(Pose::new(0.0, 0.0, 0.0), to, 1.0);
            let length: f64 = pieces.iter().map(|piece| piece.travel_m).sum();
            assert!((length - expected).abs() < 1e-9, "{to:?}: {length}, expected {expected}");
        }
    }
}
