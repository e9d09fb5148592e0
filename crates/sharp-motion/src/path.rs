//! Paths: what a planner returns and a robot follows.

use sharp_space::Pose;

/// A motion plan: poses in the order of travel, at least one.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    poses: Vec<Pose>,
}

impl Path {
    /// A path through `poses`; `None` if there is none.
    #[must_use]
    pub fn new(poses: Vec<Pose>) -> Option<Self> {
        (!poses.is_empty()).then_some(Self { poses })
    }

    /// The poses in the order of travel.
    #[must_use]
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// The first pose.
    #[must_use]
    pub fn start(&self) -> Pose {
        self.poses[0]
    }

    /// The last pose.
    #[must_use]
    pub fn end(&self) -> Pose {
        self.poses[self.poses.len() - 1]
    }

    /// Metres travelled; turns in place do not count.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.poses.windows(2).map(|pair| pair[0].distance_m(&pair[1])).sum()
    }

    /// The same path as poses at equal distances of at most `spacing_m` metres of travel, both ends kept.
    ///
    /// A turn in place falls between two samples.
    ///
    /// # Panics
    /// If `spacing_m` is not positive.
    #[must_use]
    pub fn resample(&self, spacing_m: f64) -> Self {
        assert!(spacing_m > 0.0, "spacing is {spacing_m} m, must be positive");
        let length = self.length_m();
        let count = (length / spacing_m).ceil() as usize;
        let mut poses = Vec::with_capacity(count + 1);
        poses.push(self.start());
        let (mut segment, mut before) = (0, 0.0);
        for i in 1..count {
            let arc = length * i as f64 / count as f64;
            let mut step = self.poses[segment].distance_m(&self.poses[segment + 1]);
            while before + step < arc && segment + 2 < self.poses.len() {
                before += step;
                segment += 1;
                step = self.poses[segment].distance_m(&self.poses[segment + 1]);
            }
            let share = if step > 0.0 { ((arc - before) / step).min(1.0) } else { 0.0 };
            poses.push(self.poses[segment].interpolate(&self.poses[segment + 1], share));
        }
        if self.poses.len() > 1 {
            poses.push(self.end());
        }
        Self { poses }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resampling_keeps_ends_and_spaces_evenly() {
        let corner = [(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (1.0, 2.0)];
        let path = Path::new(corner.map(|(x, y)| Pose::new(x, y, 0.0)).to_vec()).unwrap();
        assert_eq!(path.length_m(), 3.0);
        let fine = path.resample(0.4);
        assert_eq!(fine.poses().len(), 9, "eight steps of 0.375 m");
        assert_eq!((fine.start(), fine.end()), (path.start(), path.end()), "ends");
        assert!((fine.poses()[4].position.y - 0.5).abs() < 1e-12, "1.5 m along: {:?}", fine.poses()[4]);
    }

    #[test]
    fn a_path_of_one_pose_has_no_length() {
        let path = Path::new(vec![Pose::new(1.0, 2.0, 3.0)]).unwrap();
        assert_eq!(path.length_m(), 0.0);
        assert_eq!(path.resample(0.1), path);
        assert_eq!(Path::new(vec![]), None, "a path without poses");
    }
}
