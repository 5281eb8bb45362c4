//! The fastest ds/dt along given paths: `postproc.motion.topp`.
//!
//! Reachability analysis (Pham and Pham: A New Approach to Time-Optimal Path
//! Parameterization Based on Reachability Analysis, IEEE Transactions on Robotics 2018).
//! Of x = (ds/dt)^2 at a waypoint and y at the next one, the joints' accelerations at both
//! are linear, and standing still breaks no bound: what can be braked from is [0, top].

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::rows::{each, flat, row, rows, same_length, Six};

/// Joints, at both ends of an interval, and both senses of each.
const BOUNDS: usize = 24;

/// Paths and their bounds, at the waypoints.
struct Path<'a> {
    /// dq/ds and its derivative.
    slope: &'a [Six],
    curve: &'a [Six],
    /// Path length since the waypoint before.
    step: &'a [f64],
    /// Of joint accelerations [rad/s^2].
    acceleration: Six,
}

impl Path<'_> {
    /// Bounds p x + r y <= 1 of the interval that begins at a waypoint: (p, r).
    fn bounds(&self, i: usize) -> [(f64, f64); BOUNDS] {
        let mut out = [(0.0, 0.0); BOUNDS];
        for (j, limit) in self.acceleration.iter().enumerate() {
            let push = 1.0 / (2.0 * self.step[i + 1] * limit);
            let (here, there) = (self.slope[i][j] * push, self.slope[i + 1][j] * push);
            let (p, r) = (self.curve[i][j] / limit - here, here);
            (out[4 * j], out[4 * j + 1]) = ((p, r), (-p, -r));
            let (p, r) = (-there, there + self.curve[i + 1][j] / limit);
            (out[4 * j + 2], out[4 * j + 3]) = ((p, r), (-p, -r));
        }
        out
    }
}

/// Corners of a convex region, one behind the other.
struct Region {
    corners: [(f64, f64); BOUNDS + 4],
    count: usize,
}

impl Region {
    /// All x up to a bound and y up to another.
    fn below(x: f64, y: f64) -> Region {
        let mut corners = [(0.0, 0.0); BOUNDS + 4];
        corners[1..4].copy_from_slice(&[(x, 0.0), (x, y), (0.0, y)]);
        Region { corners, count: 4 }
    }

    /// Keep what lies within p x + r y <= 1 (Sutherland and Hodgman: Reentrant polygon
    /// clipping, Communications of the ACM 1974).
    fn cut(&mut self, (p, r): (f64, f64)) {
        let beyond = |(x, y): (f64, f64)| p * x + r * y - 1.0;
        let given = &self.corners[..self.count];
        if given.iter().all(|c| beyond(*c) <= 0.0) {
            return;
        }
        let (mut kept, mut count) = ([(0.0, 0.0); BOUNDS + 4], 0);
        let mut last = given[self.count - 1];
        let mut before = beyond(last);
        for corner in given {
            let now = beyond(*corner);
            if (before > 0.0) != (now > 0.0) {
                let u = before / (before - now);
                kept[count] = (last.0 + u * (corner.0 - last.0), last.1 + u * (corner.1 - last.1));
                count += 1;
            }
            if now <= 0.0 {
                kept[count] = *corner;
                count += 1;
            }
            (last, before) = (*corner, now);
        }
        (self.corners, self.count) = (kept, count);
    }

    fn largest_x(&self) -> f64 {
        self.corners[..self.count].iter().fold(0.0, |most, corner| corner.0.max(most))
    }
}

/// The largest y that some bounds allow, given x.
fn largest_y(bounds: &[(f64, f64)], x: f64, top: f64) -> f64 {
    let reach = |most: f64, &(p, r): &(f64, f64)| match r > 0.0 {
        true => most.min((1.0 - p * x) / r),
        false => most,
    };
    bounds.iter().fold(top, reach).max(0.0)
}

/// Find ds/dt at k waypoints, (k,): 0 at both ends of each run, else the fastest.
///
/// `slope`, `curve`: dq/ds and its derivative, (k, 6). `step`: path length since the waypoint
/// before, (k,). `bound`: of ds/dt, (k,), finite. `begins`: the first waypoint of each run.
/// `acceleration`: bounds of the joints [rad/s^2].
#[pyfunction]
pub fn fastest<'py>(
    py: Python<'py>,
    paths: (PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, f64>),
    step: PyReadonlyArray1<'py, f64>,
    bound: PyReadonlyArray1<'py, f64>,
    begins: PyReadonlyArray1<'py, bool>,
    acceleration: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (slope, curve) = (rows::<6>(&paths.0)?, rows::<6>(&paths.1)?);
    let (bound, begins, step) = (flat(&bound)?, flat(&begins)?, flat(&step)?);
    let n = same_length(&[slope.len(), curve.len(), step.len(), bound.len(), begins.len()])?;
    let path = Path { slope, curve, step, acceleration: row(&acceleration)? };
    let ends = |i: usize| i + 1 == n || begins[i + 1];
    let mut next = 0.0;
    let mut top = each(py, n, |k| {
        let i = n - 1 - k;
        next = if ends(i) {
            0.0
        } else {
            let mut region = Region::below(bound[i] * bound[i], next);
            path.bounds(i).iter().for_each(|b| region.cut(*b));
            region.largest_x()
        };
        next
    })?;
    top.reverse();
    let mut here = 0.0;
    let rate = each(py, n, |i| {
        here = match begins[i] || i == 0 {
            true => 0.0,
            false => largest_y(&path.bounds(i - 1), here, top[i]),
        };
        f64::sqrt(here)
    })?;
    Ok(rate.into_pyarray(py))
}
