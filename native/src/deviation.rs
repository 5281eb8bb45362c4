//! How far joint angles lead the arm from others: `postproc.motion.deviation`.

use std::ops::Range;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::chain::{Chain, Parameters};
use crate::edges::{Edges, Paths};
use crate::rows::{array, at_best, dot, flat, in_parts, minus, row, rows, same_length, Six, Three};
use crate::solver::Solver;

/// Rows that are worth a thread.
const LEAST: usize = 4096;

/// Ways that are.
const LEAST_WAYS: usize = 512;
/// [rad] at axis 5, below this the two branches of the wrist are one.
pub const STRAIGHT: f64 = 1e-3;
const WRIST: i64 = 4; // bit of a branch

type Pair<'py> = (PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, f64>);
type Rows<'py> = Bound<'py, PyArray2<f64>>;
/// Changes of joints (n, 6) [rad], and of places (n, 3) [m]; which branches differ, (n,).
type Changes<'py> = (Rows<'py>, Rows<'py>, Bound<'py, PyArray1<bool>>);

/// What joint angles are compared with: an arm, and changes of its joints that are constant.
struct Comparison<'a> {
    chain: Chain,
    solver: &'a Solver,
    offset: Six,
}

/// What joints, elbow, wrist centre and TCP change by; NaN where angles are unknown.
#[derive(Clone, Copy)]
struct Change {
    joints: Six,
    places: Three,
    branch: bool,
}

const UNKNOWN: Change = Change { joints: [f64::NAN; 6], places: [f64::NAN; 3], branch: false };

impl Comparison<'_> {
    /// Compare joint angles, with the TCP in the flange frame.
    #[inline(always)]
    fn change(&self, old: &Six, new: &Six, tool: &Three) -> Change {
        let joints = std::array::from_fn(|j| excess(new[j] - old[j], self.offset[j]));
        if !are_known(old, new) {
            return Change { joints, ..UNKNOWN };
        }
        let places = displacement(&self.chain, old, new, tool);
        Change { joints, places, branch: self.is_other(old, new) }
    }

    /// Tell whether joint angles lie on other branches; a straight wrist lies on both.
    fn is_other(&self, old: &Six, new: &Six) -> bool {
        let differ = self.solver.slot(old) ^ self.solver.slot(new);
        let straight = (old[4] * new[4]).min(0.0).abs() < STRAIGHT * STRAIGHT;
        differ & !(if straight { WRIST } else { 0 }) != 0
    }
}

impl Change {
    /// Return the larger ones of two; what is not known does not count.
    #[inline(always)]
    fn largest(self, other: &Change) -> Change {
        Change {
            joints: std::array::from_fn(|j| self.joints[j].max(other.joints[j])),
            places: std::array::from_fn(|k| self.places[k].max(other.places[k])),
            branch: self.branch || other.branch,
        }
    }
}

/// Give changes to Python.
fn columns<'py>(py: Python<'py>, changes: Vec<Change>) -> Changes<'py> {
    let branch: Vec<bool> = changes.iter().map(|change| change.branch).collect();
    let joints = changes.iter().map(|change| change.joints).collect();
    let places = changes.iter().map(|change| change.places).collect();
    (array(py, joints), array(py, places), branch.into_pyarray(py))
}

/// Tell whether all joint angles of a pair are known.
#[inline(always)]
fn are_known(old: &Six, new: &Six) -> bool {
    !old.iter().chain(new).any(|angle| angle.is_nan())
}

/// By how much a change lies outside of 0 to its offset; NaN stays NaN.
#[inline(always)]
fn excess(change: f64, offset: f64) -> f64 {
    let beyond = (offset.min(0.0) - change).max(change - offset.max(0.0)).max(0.0);
    if change.is_nan() {
        change
    } else {
        beyond
    }
}

/// Tell by how much elbow, wrist centre and TCP lie apart.
#[inline(always)]
fn displacement(chain: &Chain, old: &Six, new: &Six, tool: &Three) -> Three {
    let [before, after] = [old, new].map(|q| {
        let frames = chain.frames(q);
        [frames[2].origin, frames[4].origin, frames[6].place(tool)]
    });
    std::array::from_fn(|k| {
        let way = minus(&after[k], &before[k]);
        dot(&way, &way).sqrt()
    })
}

/// Compare old and new joint angles, (n, 6) [rad]: what each changes by beyond an offset
/// (6,), (n, 6), what elbow, wrist centre and points of the flange frame move by, (n, 3)
/// [m], and which lie on other branches, (n,).
#[pyfunction]
pub fn departure<'py>(
    py: Python<'py>,
    parameters: Parameters<'py>,
    solver: &Solver,
    angles: Pair<'py>,
    point: PyReadonlyArray2<'py, f64>,
    offset: PyReadonlyArray1<'py, f64>,
) -> PyResult<Changes<'py>> {
    let (chain, offset) = (Chain::new(&parameters)?, row(&offset)?);
    let (old, new) = (rows::<6>(&angles.0)?, rows::<6>(&angles.1)?);
    let point = rows::<3>(&point)?;
    let n = same_length(&[old.len(), new.len(), point.len()])?;
    let with = Comparison { chain, solver, offset };
    let one = |i: usize| with.change(&old[i], &new[i], &point[i]);
    let part = |some: Range<usize>| at_best(|| some.map(one).collect());
    let changes = in_parts(py, n, LEAST, part)?;
    Ok(columns(py, changes))
}

/// A program's ways: its edges, and the joint angles at n visits, (n, 6) [rad].
type Ways<'py> = (Edges<'py>, PyReadonlyArray2<'py, f64>);

/// Compare two programs inside of their ways, at places that cut each into as many parts:
/// the largest changes on the ways to n visits, as `departure` gives them; NaN where
/// no way is known in both.
///
/// Args: the arm; the programs; their edges to visit i are first[i] .. first[i + 1] - 1,
/// (n + 1,); the parts of each edge, (e,); at which visits a change of branch counts, (n,);
/// points and offset as for `departure`.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // two programs
pub fn departure_along<'py>(
    py: Python<'py>,
    parameters: Parameters<'py>,
    solver: &Solver,
    ways: (Ways<'py>, Ways<'py>),
    first: PyReadonlyArray1<'py, i64>,
    parts: PyReadonlyArray1<'py, i64>,
    branched: PyReadonlyArray1<'py, bool>,
    point: PyReadonlyArray2<'py, f64>,
    offset: PyReadonlyArray1<'py, f64>,
) -> PyResult<Changes<'py>> {
    let with = Comparison { chain: Chain::new(&parameters)?, solver, offset: row(&offset)? };
    let ((old, old_q), (new, new_q)) = &ways;
    let (old, new) = (Paths::of(old, old_q)?, Paths::of(new, new_q)?);
    let (first, parts, branched) = (flat(&first)?, flat(&parts)?, flat(&branched)?);
    let point = rows::<3>(&point)?;
    let n = same_length(&[point.len(), branched.len(), first.len().saturating_sub(1)])?;
    let edges = same_length(&[parts.len(), old.len(), new.len()])?;
    if first.iter().any(|edge| !(0..=edges as i64).contains(edge)) {
        return Err(PyIndexError::new_err("edges that are not there"));
    }
    let on_edge = |edge: usize, tool: &Three| {
        let (Some(before), Some(after)) = (old.find(edge), new.find(edge)) else {
            return UNKNOWN;
        };
        let count = parts[edge];
        let share = |k: i64| k as f64 / count as f64;
        let there = |k: i64| (before.straight_at(share(k)), after.straight_at(share(k)));
        let places = (1..count).map(there).filter(|(a, b)| are_known(a, b));
        places.fold(UNKNOWN, |most, (a, b)| most.largest(&with.change(&a, &b, tool)))
    };
    let one = |i: usize| {
        let some = (first[i]..first[i + 1]).map(|edge| edge as usize);
        let same = some.filter(|edge| old.source(*edge) == new.source(*edge));
        let most = same.fold(UNKNOWN, |most, edge| most.largest(&on_edge(edge, &point[i])));
        Change { branch: most.branch && branched[i], ..most }
    };
    let part = |some: Range<usize>| at_best(|| some.map(one).collect());
    let changes = in_parts(py, n, LEAST_WAYS, part)?;
    Ok(columns(py, changes))
}
