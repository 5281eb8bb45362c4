//! Stretches of a path, each followed on one branch: `postproc.motion.joint_path`.

use std::ops::Range;

use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::lines::{poses, Pose};
use crate::numeric::UNSOLVED;
use crate::rows::{array, each, flat, row, rows, same_length, Six};
use crate::solver::Solver;
use crate::turns::{nearest_turn, ranged};

/// Lower and upper limits of the joints [rad].
type Limits<'py> = (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>);

/// Targets, the edges to them with their samples, and r stretches of them.
#[derive(FromPyObject)]
pub struct Stretches<'py> {
    /// Flange poses at targets (n, 4, 4) and between them (k, 4, 4) [m].
    targets: PyReadonlyArray3<'py, f64>,
    between: PyReadonlyArray3<'py, f64>,
    /// Where the pose of each sample stands between targets, or -1 less a target, (s,).
    place: PyReadonlyArray1<'py, i64>,
    /// Samples start[i] .. start[i + 1] - 1 are those of edge i, (e + 1,).
    start: PyReadonlyArray1<'py, i64>,
    /// First edge of each stretch, and how many it has, (r,).
    edge: PyReadonlyArray1<'py, i64>,
    count: PyReadonlyArray1<'py, i64>,
    /// Joint angles before each, (r, 6) [rad], and its branch, (r,).
    near: PyReadonlyArray2<'py, f64>,
    slot: PyReadonlyArray1<'py, i64>,
}

/// Return the edges and the samples of a stretch; None if they do not exist.
fn spans(start: &[i64], edge: i64, count: i64) -> Option<Vec<Range<usize>>> {
    let first = usize::try_from(edge).ok()?;
    let ends = start.get(first..=first + usize::try_from(count).ok()?)?;
    let span = |pair: &[i64]| Some(usize::try_from(pair[0]).ok()?..usize::try_from(pair[1]).ok()?);
    ends.windows(2).map(span).collect()
}

/// Follow stretches sample by sample, up to the first one that a joint is too far from.
///
/// Args: the inverse kinematics; the stretches; the limits of the joints; steps [rad] of a
/// joint that are not too large, to the first sample of a stretch and to any other one.
///
/// Returns: joint angles (s, 6) [rad], on the turns that continue their stretches, NaN on
/// edges that are not followed to their ends; how many edges of each stretch are, (r,).
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn along_stretches<'py>(
    py: Python<'py>,
    solver: &Solver,
    stretches: Stretches<'py>,
    limits: Limits<'py>,
    steps: (f64, f64),
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<i64>>)> {
    let (targets, between) = (poses(&stretches.targets)?, poses(&stretches.between)?);
    let (place, lower, upper) = (flat(&stretches.place)?, row(&limits.0)?, row(&limits.1)?);
    let (edge, count, start) =
        (flat(&stretches.edge)?, flat(&stretches.count)?, flat(&stretches.start)?);
    let (near, slot) = (rows::<6>(&stretches.near)?, flat(&stretches.slot)?);
    let r = same_length(&[edge.len(), count.len(), near.len(), slot.len()])?;
    let pose = |at: i64| -> Option<&Pose> {
        match usize::try_from(at) {
            Ok(inside) => between.get(inside),
            Err(_) => targets.get(usize::try_from(-1 - at).ok()?),
        }
    };
    let placed: Option<Vec<&Pose>> = place.iter().map(|at| pose(*at)).collect();
    let placed = placed.ok_or_else(|| PyIndexError::new_err("a pose that is not there"))?;
    let edges: Option<Vec<_>> = (0..r).map(|k| spans(start, edge[k], count[k])).collect();
    let edges = edges.filter(|all| all.iter().flatten().all(|span| span.end <= placed.len()));
    let edges = edges.ok_or_else(|| PyIndexError::new_err("samples that are not there"))?;
    let (mut q, mut before) = (vec![[f64::NAN; 6]; placed.len()], [UNSOLVED; 8]);
    let done = each(py, r, |k| {
        let (mut at, mut most) = (near[k], steps.0);
        let mut follow = |sample: usize| {
            let solved = solver.on_branch(placed[sample], slot[k], &mut before);
            let ranged = |j: usize| ranged(solved[j], lower[j], upper[j]);
            let next: Six = std::array::from_fn(|j| nearest_turn(ranged(j), at[j]));
            let good = (0..6).all(|j| (next[j] - at[j]).abs() <= most);
            (q[sample], at, most) = (next, next, steps.1);
            good
        };
        let broken = edges[k].iter().position(|span| !span.clone().all(&mut follow));
        if let Some(first) = broken {
            q[edges[k][first].clone()].fill([f64::NAN; 6]);
        }
        broken.unwrap_or(edges[k].len()) as i64
    })?;
    Ok((array(py, q), done.into_pyarray(py)))
}
