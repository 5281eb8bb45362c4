//! Poses on Cartesian paths: `postproc.motion.path.Segments`.

use numpy::{PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::lines::{poses, Pose};
use crate::pose::{inverted, product, rotation_from_vector};
use crate::rows::{blocks, each, flat, rows, same_length};
use crate::trig::sin_cos;

/// Rotation at the start, turn, centre, radius, tangent, chord, and angle.
type Segment = [f64; 25];

/// Place the TCP at a fraction of a path.
fn pose(segment: &Segment, u: f64) -> Pose {
    let [turn, centre, radius, tangent, chord] =
        [9, 12, 15, 18, 21].map(|at| [segment[at], segment[at + 1], segment[at + 2]]);
    let ([sin], [cos]) = sin_cos(&[u * segment[24]]);
    let turned = rotation_from_vector(turn.map(|part| u * part));
    let mut out = [0.0; 16];
    for i in 0..3 {
        let own = &segment[3 * i..3 * i + 3];
        for j in 0..3 {
            out[4 * i + j] = own[0] * turned[j] + own[1] * turned[3 + j] + own[2] * turned[6 + j];
        }
        out[4 * i + 3] = centre[i] + u * chord[i] + (cos * radius[i] + sin * tangent[i]);
    }
    out[15] = 1.0;
    out
}

/// Place the TCP, or a flange, at fractions (s,) of paths `path` (s,) of m: (s, 4, 4).
///
/// The tools are (t, 4, 4) in the flange frame, `tool` says which of them each path has,
/// (m,); no tools: poses are those of the TCP.
#[pyfunction]
pub fn poses_along<'py>(
    py: Python<'py>,
    segments: PyReadonlyArray2<'py, f64>,
    path: PyReadonlyArray1<'py, i64>,
    share: PyReadonlyArray1<'py, f64>,
    tools: PyReadonlyArray3<'py, f64>,
    tool: PyReadonlyArray1<'py, i64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (segments, path, share) = (rows::<25>(&segments)?, flat(&path)?, flat(&share)?);
    let (tools, tool) = (poses(&tools)?, flat(&tool)?);
    let n = same_length(&[path.len(), share.len()])?;
    let from_tcp: Vec<Pose> = tools.iter().map(inverted).collect();
    let exists = |index: &i64, m: usize| (0..m as i64).contains(index);
    let has_tools = from_tcp.is_empty()
        || tool.len() == segments.len() && tool.iter().all(|k| exists(k, from_tcp.len()));
    if !has_tools || !path.iter().all(|k| exists(k, segments.len())) {
        return Err(PyIndexError::new_err("a path or a tool that is not there"));
    }
    let placed = each(py, n, |i| {
        let k = path[i] as usize;
        let tcp = pose(&segments[k], share[i]);
        from_tcp.get(tool.get(k).map_or(0, |t| *t as usize)).map_or(tcp, |from| product(&tcp, from))
    })?;
    Ok(blocks(py, n, (4, 4), placed.into_flattened()))
}
