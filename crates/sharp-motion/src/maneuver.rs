//! What a robot drives between two poses: up to three pieces of constant curvature.

use sharp_space::{Heading, Pose, Vector, trig};

/// Metres that a turn in place of one radian is worth when lengths are compared.
///
/// A Husky turns at 2 rad/s and drives at 1 m/s, so a radian costs the time of half a metre; half
/// of that, because both ramp up and turning near a wall is no slower than driving there.
const PIVOT_COST_M_PER_RAD: f64 = 0.25;

/// A piece of constant curvature: an arc, a straight (`turn_rad` 0) or a turn in place (`travel_m` 0).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Primitive {
    /// Distance driven forward, metres, never negative.
    pub travel_m: f64,
    /// Change of heading, radians, positive to the left.
    pub turn_rad: f64,
}

impl Primitive {
    /// The pose reached from `from` after a share `t` of the piece.
    #[must_use]
    pub fn advance(&self, from: Pose, t: f64) -> Pose {
        let (travel, turn) = (self.travel_m * t, self.turn_rad * t);
        let local = if turn.abs() < 1e-9 {
            Vector::new(travel, 0.0)
        } else {
            let radius = travel / turn;
            Vector::new(radius * trig::sin(turn), radius * (1.0 - trig::cos(turn)))
        };
        Pose::at(from.to_world(local), Heading::new(from.heading.radians() + turn))
    }

    /// Metres of travel, or radians of a turn in place: what sampling divides.
    fn extent(&self) -> f64 {
        if self.travel_m > 0.0 { self.travel_m } else { self.turn_rad.abs() }
    }

    pub(crate) fn cost_m(&self) -> f64 {
        if self.travel_m > 0.0 { self.travel_m } else { PIVOT_COST_M_PER_RAD * self.turn_rad.abs() }
    }

    fn part(&self, t: f64) -> Self {
        Self { travel_m: self.travel_m * t, turn_rad: self.turn_rad * t }
    }
}

/// A drivable connection of two poses. Both ends are exact; the poses between are integrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Maneuver {
    from: Pose,
    to: Pose,
    pieces: [Primitive; 3],
}

impl Maneuver {
    pub(crate) const fn new(from: Pose, to: Pose, pieces: [Primitive; 3]) -> Self {
        Self { from, to, pieces }
    }

    /// Where it begins.
    #[must_use]
    pub const fn from(&self) -> Pose {
        self.from
    }

    /// Where it ends.
    #[must_use]
    pub const fn to(&self) -> Pose {
        self.to
    }

    /// Distance driven, metres.
    #[must_use]
    pub fn travel_m(&self) -> f64 {
        self.pieces.iter().map(|piece| piece.travel_m).sum()
    }

    /// Distance driven plus what the turns in place are worth, metres.
    #[must_use]
    pub fn cost_m(&self) -> f64 {
        self.pieces.iter().map(Primitive::cost_m).sum()
    }

    /// Returns true if `holds` for poses at most `step_m` apart, both ends included.
    ///
    /// A turn in place is sampled every `step_m` radians: a corner a metre away moves that far.
    pub fn all(&self, step_m: f64, mut holds: impl FnMut(Pose) -> bool) -> bool {
        if !holds(self.from) {
            return false;
        }
        let Some(last) = self.pieces.iter().rposition(|piece| piece.extent() > 0.0) else {
            return holds(self.to);
        };
        let mut from = self.from;
        for (number, piece) in self.pieces[..=last].iter().enumerate() {
            let steps = (piece.extent() / step_m).ceil();
            for i in 1..steps as usize {
                if !holds(piece.advance(from, i as f64 / steps)) {
                    return false;
                }
            }
            from = if number == last { self.to } else { piece.advance(from, 1.0) };
            if steps > 0.0 && !holds(from) {
                return false;
            }
        }
        true
    }

    /// The poses that [`all`](Self::all) visits.
    #[must_use]
    pub fn poses(&self, step_m: f64) -> Vec<Pose> {
        let mut poses = Vec::new();
        self.all(step_m, |pose| {
            poses.push(pose);
            true
        });
        poses
    }

    /// The first `range_m` metres of travel, with the turns in place before them.
    #[must_use]
    pub fn prefix(&self, range_m: f64) -> Self {
        let mut left = range_m;
        let mut pieces = [Primitive::default(); 3];
        let mut to = self.from;
        for (kept, piece) in pieces.iter_mut().zip(&self.pieces) {
            if piece.travel_m > left {
                *kept = piece.part(left / piece.travel_m);
                return Self { from: self.from, to: kept.advance(to, 1.0), pieces };
            }
            left -= piece.travel_m;
            *kept = *piece;
            to = piece.advance(to, 1.0);
        }
        *self
    }

    /// The last `range_m` metres of travel, with the turns in place after them.
    #[must_use]
    pub fn suffix(&self, range_m: f64) -> Self {
        let skipped = self.travel_m() - range_m;
        if skipped <= 0.0 {
            return *self;
        }
        let mut left = skipped;
        let mut from = self.from;
        let mut pieces = self.pieces;
        for piece in &mut pieces {
            if piece.travel_m > left {
                let share = left / piece.travel_m;
                from = piece.advance(from, share);
                *piece = piece.part(1.0 - share);
                break;
            }
            left -= piece.travel_m;
            from = piece.advance(from, 1.0);
            *piece = Primitive::default();
        }
        Self { from, to: self.to, pieces }
    }
}
