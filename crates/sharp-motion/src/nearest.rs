//! Nearest neighbours in SE(2) under any distance that is at least the straight one.
//!
//! Positions are kept in hashed square buckets; a query walks rings of buckets outwards and stops
//! when no bucket further out can hold anything nearer. Ties go to the position inserted first.

use sharp_space::Point;

/// Enough for trees of some thousand nodes; more nodes only make the chains longer.
const BUCKETS: usize = 1024;
/// Marks the end of a chain.
const NONE: u32 = u32::MAX;
/// Below this size it is faster to compare all points than to walk rings.
const LINEAR_MAX: usize = 24;

/// An index of positions, numbered in the order of insertion.
#[derive(Clone, Debug)]
pub struct Nearest {
    bucket_m: f64,
    points: Vec<Point>,
    /// The last position inserted into each bucket, or [`NONE`].
    heads: Vec<u32>,
    /// The position inserted before into the same bucket, or [`NONE`].
    next: Vec<u32>,
    /// The rectangle of bucket coordinates in use: no ring needs to reach further.
    low: [i32; 2],
    high: [i32; 2],
}

impl Nearest {
    /// An empty index with buckets of `bucket_m` metres; about the usual distance of neighbours is best.
    #[must_use]
    pub fn new(bucket_m: f64) -> Self {
        Self {
            bucket_m,
            points: Vec::new(),
            heads: vec![NONE; BUCKETS],
            next: Vec::new(),
            low: [i32::MAX; 2],
            high: [i32::MIN; 2],
        }
    }

    /// Adds a position; its number is the count of those before.
    pub fn insert(&mut self, point: Point) {
        let at = self.bucket(point);
        let slot = slot(at);
        self.next.push(self.heads[slot]);
        self.heads[slot] = self.points.len() as u32;
        self.points.push(point);
        self.low = [self.low[0].min(at[0]), self.low[1].min(at[1])];
        self.high = [self.high[0].max(at[0]), self.high[1].max(at[1])];
    }

    /// The number of the position with the lowest `cost`, which must be at least the straight distance.
    ///
    /// `None` if the index is empty or every cost is infinite.
    pub fn nearest(&self, point: Point, mut cost: impl FnMut(usize) -> f64) -> Option<usize> {
        let mut best = NearestSoFar { cost: f64::INFINITY, index: usize::MAX };
        if self.points.len() <= LINEAR_MAX {
            for index in 0..self.points.len() {
                self.offer(&mut best, point, index, &mut cost);
            }
            return best.found();
        }
        let center = self.bucket(point);
        let reach =
            (0..2).map(|a| (center[a] - self.low[a]).max(self.high[a] - center[a])).max().expect("two axes");
        for ring in 0..=reach {
            // The query may stand at the rim of its bucket, so a ring is one bucket nearer than its number.
            if f64::from(ring - 1) * self.bucket_m > best.cost {
                break;
            }
            self.visit_ring(center, ring, |index| self.offer(&mut best, point, index, &mut cost));
        }
        best.found()
    }

    fn offer(
        &self,
        best: &mut NearestSoFar,
        point: Point,
        index: usize,
        cost: &mut impl FnMut(usize) -> f64,
    ) {
        if (self.points[index] - point).norm_squared() > best.cost * best.cost {
            return;
        }
        let cost = cost(index);
        if cost < best.cost || (cost <= best.cost && index < best.index) {
            *best = NearestSoFar { cost, index };
        }
    }

    fn visit_ring(&self, center: [i32; 2], ring: i32, mut visit: impl FnMut(usize)) {
        let rows = (center[1] - ring).max(self.low[1])..=(center[1] + ring).min(self.high[1]);
        for row in rows {
            let whole_row = (row - center[1]).abs() == ring;
            let step = if whole_row || ring == 0 { 1 } else { 2 * ring };
            let mut col = center[0] - ring;
            while col <= center[0] + ring {
                if (self.low[0]..=self.high[0]).contains(&col) {
                    self.visit_bucket([col, row], &mut visit);
                }
                col += step;
            }
        }
    }

    fn visit_bucket(&self, bucket: [i32; 2], visit: &mut impl FnMut(usize)) {
        let mut index = self.heads[slot(bucket)];
        while index != NONE {
            visit(index as usize);
            index = self.next[index as usize];
        }
    }

    fn bucket(&self, point: Point) -> [i32; 2] {
        [(point.x / self.bucket_m).floor() as i32, (point.y / self.bucket_m).floor() as i32]
    }
}

struct NearestSoFar {
    cost: f64,
    index: usize,
}

impl NearestSoFar {
    fn found(self) -> Option<usize> {
        (self.index != usize::MAX).then_some(self.index)
    }
}

/// Neighbouring buckets get neighbouring slots. Within a block of 32 by 32 buckets no two share a slot.
fn slot(bucket: [i32; 2]) -> usize {
    (bucket[0].rem_euclid(32) + 32 * bucket[1].rem_euclid(32)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_comparing_all() {
        arbtest::arbtest(|u| {
            let mut real = |max: i32| u.int_in_range(-max..=max).map(|i| f64::from(i) / 100.0);
            let mut points = Vec::new();
            for _ in 0..120 {
                // Eighty metres: farther than 32 buckets, so that slots clash.
                points.push((Point::new(real(4000)?, real(4000)?), real(100)?.abs()));
            }
            let mut index = Nearest::new(1.0);
            points.iter().for_each(|(point, _)| index.insert(*point));
            let query = Point::new(real(5000)?, real(5000)?);
            let cost = |i: usize| (points[i].0 - query).norm() + points[i].1;
            let expected = (0..points.len()).min_by(|&a, &b| cost(a).total_cmp(&cost(b)));
            assert_eq!(index.nearest(query, cost), expected, "query {query}");
            Ok(())
        });
    }

    #[test]
    fn an_empty_index_has_no_neighbour() {
        assert_eq!(Nearest::new(1.0).nearest(Point::origin(), |_| 0.0), None);
    }
}
