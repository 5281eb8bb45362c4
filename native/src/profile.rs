//! Backlash along the gear: `postproc.model.effects.backlash_profile`.

use std::f64::consts::{PI, TAU};

use numpy::{PyArray2, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::rows::{array, each, flat, groups, rows, same_length, Six};
use crate::trig::sin_cos;

const EDGE: f64 = 0.1; // share of the range over which the profile fades outside of it

/// The factor of an angle: 1 in the range and falling outside of it, turn by turn.
fn faded(angle: f64, low: f64, high: f64) -> f64 {
    if (low..=high).contains(&angle) || high - low > 0.95 * TAU {
        return 1.0;
    }
    let middle = (low + high) / 2.0;
    let near = middle + (angle - middle + PI).rem_euclid(TAU) - PI;
    let out = (low - near).max(near - high).max(0.0) / (EDGE * (high - low)).max(1e-9);
    let t = out.clamp(0.0, 1.0);
    ((1.0 - t * t * (3.0 - 2.0 * t)) * 1e12).round_ties_even() / 1e12
}

/// What a joint's error is made of.
struct Joint<'a> {
    at: usize,
    low: f64,
    high: f64,
    /// b0, where it is one of the sizes.
    mean: f64,
    /// Of sine and cosine, order by order.
    sizes: &'a [[f64; 2]],
}

impl Joint<'_> {
    /// The error on the upper flank. Sine and cosine of k theta come from those of
    /// (k - 1) theta.
    fn error(&self, angle: f64, (sin, cos): (f64, f64), slot: &[usize]) -> f64 {
        let within = faded(angle, self.low, self.high);
        let (mut total, mut s, mut c) = (self.mean, 0.0, 1.0);
        for slot in slot {
            (s, c) = (s * cos + c * sin, c * cos - s * sin);
            if let Some([of_sin, of_cos]) = self.sizes.get(*slot) {
                total += of_sin * (s * within);
                total += of_cos * (c * within);
            }
        }
        total
    }
}

/// The joint errors (n, 6) [rad].
///
/// `sizes` (j, m) holds what b0, where it is `constant`, then sine and cosine of each
/// order are multiplied by, for each of the joints. States: angles [rad], directions,
/// (n, 6) each. Range: lower and upper end of all six joints.
#[pyfunction]
pub fn profile<'py>(
    py: Python<'py>,
    states: (PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, f64>),
    joints: Vec<usize>,
    orders: Vec<usize>,
    constant: bool,
    sizes: PyReadonlyArray2<'py, f64>,
    range: (Six, Six),
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (q, direction) = (rows::<6>(&states.0)?, rows::<6>(&states.1)?);
    let (lower, upper) = range;
    same_length(&[q.len(), direction.len()])?;
    let width = usize::from(constant) + 2 * orders.len();
    if sizes.shape() != [joints.len(), width] || joints.iter().any(|j| *j >= 6) {
        return Err(PyValueError::new_err("sizes of other joints or orders"));
    }
    // Where in the sizes the sine and cosine of each order from 1 on stand, if at all.
    let slot: Vec<usize> = (1..=orders.iter().copied().max().unwrap_or(0))
        .map(|k| orders.iter().position(|o| *o == k).unwrap_or(usize::MAX))
        .collect();
    let skipped = usize::from(constant);
    let sizes = flat(&sizes)?;
    let joints: Vec<Joint> = (joints.iter().enumerate())
        .map(|(row, at)| {
            let own = &sizes[row * width..(row + 1) * width];
            Joint {
                at: *at,
                low: lower[*at],
                high: upper[*at],
                mean: if constant { own[0] } else { 0.0 },
                sizes: groups(&own[skipped..]),
            }
        })
        .collect();
    let row = |(q, direction): (&Six, &Six)| -> Six {
        let (mut out, (sin, cos)) = ([0.0; 6], sin_cos(q));
        for joint in &joints {
            let at = joint.at;
            out[at] = joint.error(q[at], (sin[at], cos[at]), &slot);
        }
        std::array::from_fn(|j| out[j] * direction[j])
    };
    Ok(array(py, each(py, q.len(), |i| row((&q[i], &direction[i])))?))
}
