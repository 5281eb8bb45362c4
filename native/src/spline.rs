//! Natural cubic splines through the waypoints of many runs: `postproc.motion.topp`.
//!
//! With the step h and the slope m of an interval, the first derivatives d satisfy
//! d_i-1 / h_i-1 + 2 d_i (1/h_i-1 + 1/h_i) + d_i+1 / h_i = 3 (m_i-1 / h_i-1 + m_i / h_i), and
//! 2 d_0 + d_1 = 3 m_0 at a free end (de Boor: A Practical Guide to Splines, chapter 4).

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::rows::{array, each, flat, rows, same_length, Six};

/// First and second derivatives at waypoints, (k, 6) each.
type Derivatives<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// A combination of two rows.
fn mix(a: f64, x: &Six, b: f64, y: &Six) -> Six {
    std::array::from_fn(|j| a * x[j] + b * y[j])
}

/// The waypoints of runs, and where they lie along the path.
struct Waypoints<'a> {
    s: &'a [f64],
    q: &'a [Six],
    begins: &'a [bool],
}

impl Waypoints<'_> {
    fn is_last(&self, i: usize) -> bool {
        i + 1 == self.s.len() || self.begins[i + 1]
    }

    fn is_first(&self, i: usize) -> bool {
        i == 0 || self.begins[i]
    }

    /// Weight of the interval behind a waypoint, and its slope.
    fn interval(&self, i: usize) -> (f64, Six) {
        let h = self.s[i + 1] - self.s[i];
        (1.0 / h, mix(1.0 / h, &self.q[i + 1], -1.0 / h, &self.q[i]))
    }

    /// The equation of a waypoint: diagonal and right side.
    fn equation(&self, i: usize) -> (f64, Six) {
        let mut out = (0.0, [0.0; 6]);
        for k in [(!self.is_first(i)).then(|| i - 1), (!self.is_last(i)).then_some(i)] {
            let Some(k) = k else { continue };
            let (w, slope) = self.interval(k);
            out = (out.0 + 2.0 * w, mix(1.0, &out.1, 3.0 * w, &slope));
        }
        out
    }

    /// The second derivative behind a waypoint, or before the last one of a run.
    fn bend(&self, i: usize, first: &[Six]) -> Six {
        if self.is_first(i) && self.is_last(i) {
            return [0.0; 6];
        }
        let (k, a, b) = if self.is_last(i) { (i - 1, -2.0, -4.0) } else { (i, 4.0, 2.0) };
        let (w, slope) = self.interval(k);
        let rate = mix(a, &first[k], b, &first[k + 1]);
        let sense = if self.is_last(i) { -1.0 } else { 1.0 };
        mix(6.0 * w * sense, &slope, -w, &rate)
    }
}

/// Differentiate the spline of each run at its waypoints.
///
/// `s`: path positions, increasing within a run, (k,). `q`: waypoints, (k, 6). `begins`: the
/// first waypoint of each run. The equations are diagonally dominant: elimination needs no
/// pivots.
#[pyfunction]
pub fn splines<'py>(
    py: Python<'py>,
    s: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    begins: PyReadonlyArray1<'py, bool>,
) -> PyResult<Derivatives<'py>> {
    let path = Waypoints { s: flat(&s)?, q: rows::<6>(&q)?, begins: flat(&begins)? };
    let n = same_length(&[path.s.len(), path.q.len(), path.begins.len()])?;
    let mut last = (0.0, [0.0; 6]);
    let reduced = each(py, n, |i| {
        let (diagonal, right) = path.equation(i);
        let before = if path.is_first(i) { 0.0 } else { path.interval(i - 1).0 };
        let after = if path.is_last(i) { 0.0 } else { path.interval(i).0 };
        let pivot = diagonal - before * last.0;
        last = (after / pivot, mix(1.0 / pivot, &right, -before / pivot, &last.1));
        last
    })?;
    let mut next = [0.0; 6];
    let mut first = each(py, n, |k| {
        let (factor, row) = &reduced[n - 1 - k];
        next = mix(1.0, row, -factor, &next);
        next
    })?;
    first.reverse();
    let second = each(py, n, |i| path.bend(i, &first))?;
    Ok((array(py, first), array(py, second)))
}
