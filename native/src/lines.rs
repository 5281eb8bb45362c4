//! Straight paths of the TCP: `postproc.motion.path` and `postproc.motion.blending`.

use numpy::{PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;

use crate::rows::{array, blocks, dot, each, flat, groups, minus, same_length, Three};

const SMALL: f64 = 1e-3; // [rad] below which a series stands for a quotient

/// The rows of a pose (4, 4), one after the other.
pub type Pose = [f64; 16];
pub type Rotation = [Three; 3];

/// See an array (n, 4, 4) as poses.
pub fn poses<'a>(array: &'a PyReadonlyArray3<'_, f64>) -> PyResult<&'a [Pose]> {
    if array.shape()[1..] != [4, 4] {
        return Err(PyValueError::new_err("poses are (n, 4, 4)"));
    }
    Ok(groups(flat(array)?))
}

/// Place the TCP.
pub fn point(flange: &Pose, tool: &Pose) -> Three {
    std::array::from_fn(|i| {
        let row = &flange[4 * i..];
        row[0] * tool[3] + row[1] * tool[7] + row[2] * tool[11] + row[3]
    })
}

/// Turn the TCP's axes: rows of its rotation.
fn rotation(flange: &Pose, tool: &Pose) -> Rotation {
    let row = |i: usize| [flange[4 * i], flange[4 * i + 1], flange[4 * i + 2]];
    let column = |j: usize| [tool[j], tool[4 + j], tool[8 + j]];
    std::array::from_fn(|i| std::array::from_fn(|j| dot(&row(i), &column(j))))
}

/// Return the rotation vector from one orientation to another, in the frame of the first.
fn turn(begin: &Rotation, end: &Rotation) -> Three {
    let column = |r: &Rotation, j: usize| [r[0][j], r[1][j], r[2][j]];
    let r: Rotation =
        std::array::from_fn(|i| std::array::from_fn(|j| dot(&column(begin, i), &column(end, j))));
    rotation_vector(&r)
}

/// Return the rotation vector of a rotation [rad], of a length in [0, pi].
pub fn rotation_vector(r: &Rotation) -> Three {
    let mut q = quaternion(r);
    if q[3] < 0.0 {
        q = q.map(|value| -value);
    }
    let [x, y, z, w] = q;
    let angle = 2.0 * (x * x + y * y + z * z).sqrt().atan2(w);
    let square = angle * angle;
    let scale = if angle <= SMALL {
        2.0 + square / 12.0 + 7.0 * square * square / 2880.0
    } else {
        angle / (angle / 2.0).sin()
    };
    [scale * x, scale * y, scale * z]
}

/// Return the unit quaternion x, y, z, w, from the formula with the largest divisor.
fn quaternion(r: &Rotation) -> [f64; 4] {
    let (xx, yy, zz) = (r[0][0], r[1][1], r[2][2]);
    let trace = xx + yy + zz;
    let (xy, xz, yz) = (r[1][0] + r[0][1], r[2][0] + r[0][2], r[2][1] + r[1][2]);
    let (xw, yw, zw) = (r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]);
    let mut best = 0;
    let divisors = [xx, yy, zz, trace];
    for k in 1..4 {
        if divisors[k] > divisors[best] {
            best = k;
        }
    }
    let q = match best {
        0 => [1.0 - trace + 2.0 * xx, xy, xz, xw],
        1 => [xy, 1.0 - trace + 2.0 * yy, yz, yw],
        2 => [xz, yz, 1.0 - trace + 2.0 * zz, zw],
        _ => [xw, yw, zw, 1.0 + trace],
    };
    let size = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    q.map(|value| value / size)
}

/// Two ends of a path: flange poses, and the tool on both.
struct Ends<'a> {
    begin: &'a Pose,
    end: &'a Pose,
    tool: &'a Pose,
}

/// Look up the ends of paths from targets `begin` to targets `end`; one tool is all's.
fn paths<'a>(
    flange: &'a PyReadonlyArray3<'_, f64>,
    tool: &'a PyReadonlyArray3<'_, f64>,
    begin: &PyReadonlyArray1<'_, i64>,
    end: &PyReadonlyArray1<'_, i64>,
) -> PyResult<Vec<Ends<'a>>> {
    let (flange, tool) = (poses(flange)?, poses(tool)?);
    let (begin, end) = (flat(begin)?, flat(end)?);
    same_length(&[begin.len(), end.len()])?;
    let found = |(from, to): (&i64, &i64)| {
        let (from, to) = (usize::try_from(*from).ok()?, usize::try_from(*to).ok()?);
        let tool = if tool.len() == 1 { &tool[0] } else { tool.get(to)? };
        Some(Ends { begin: flange.get(from)?, end: flange.get(to)?, tool })
    };
    let all: Option<Vec<Ends<'a>>> = begin.iter().zip(end).map(found).collect();
    all.ok_or_else(|| PyIndexError::new_err("a path between targets that are not there"))
}

/// Build the straight paths between targets.
///
/// Returns: orientations at their begin (m, 3, 3), rotation vectors to their end in that
/// frame (m, 3) [rad], where they begin (m, 3) and their chords (m, 3) [m].
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn lines<'py>(
    py: Python<'py>,
    flange: PyReadonlyArray3<'py, f64>,
    tool: PyReadonlyArray3<'py, f64>,
    begin: PyReadonlyArray1<'py, i64>,
    end: PyReadonlyArray1<'py, i64>,
) -> PyResult<(
    Bound<'py, PyArray3<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
)> {
    let all = paths(&flange, &tool, &begin, &end)?;
    let mut rotations = Vec::with_capacity(9 * all.len());
    let (mut turns, mut begins, mut chords) = (Vec::new(), Vec::new(), Vec::new());
    each(py, all.len(), |i| {
        let path = &all[i];
        let from = rotation(path.begin, path.tool);
        turns.push(turn(&from, &rotation(path.end, path.tool)));
        rotations.extend_from_slice(from.as_flattened());
        let start = point(path.begin, path.tool);
        chords.push(minus(&point(path.end, path.tool), &start));
        begins.push(start);
    })?;
    let rotations = blocks(py, all.len(), (3, 3), rotations);
    Ok((rotations, array(py, turns), array(py, begins), array(py, chords)))
}
