//! The inverse kinematics of any chain, by Newton's method from many starts:
//! `postproc.robot.inverse`.

use std::f64::consts::{PI, TAU};

use numpy::{PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;

use crate::chain::{Chain, Parameters};
use crate::lines::{poses, Pose};
use crate::rows::{blocks, dot, each, minus, Six, Three};
use crate::walk::cross;

const STARTS: usize = 160;
const ROUNDS: usize = 30;
const STEP: f64 = 0.6; // [rad] that a joint goes at once, at the most
const CLOSE: f64 = 1e-11; // [m, rad]
const SAME: f64 = 1e-6; // [rad] between two solutions that are one
pub const UNSOLVED: Six = [f64::NAN; 6];

/// A chain, and places of it to start from.
pub struct Numeric {
    chain: Chain,
    starts: Vec<Six>,
}

impl Numeric {
    pub fn new(parameters: &Parameters<'_>) -> PyResult<Numeric> {
        // A Kronecker sequence fills the six angles evenly: powers of the root of
        // x^7 = x + 1.
        let root: f64 = 1.112_775_684_278_705_5;
        let share = |i: usize, j: usize| ((i + 1) as f64 * root.powi(-(j as i32 + 1))).fract();
        let start = |i: usize| std::array::from_fn(|j| TAU * share(i, j) - PI);
        Ok(Numeric { chain: Chain::new(parameters)?, starts: (0..STARTS).map(start).collect() })
    }

    /// Solve for all branches, from those of a pose that may be near first.
    pub fn branches(&self, pose: &Pose, before: &[Six; 8]) -> [Six; 8] {
        if pose.iter().any(|x| x.is_nan()) {
            return [UNSOLVED; 8];
        }
        let mut found = [UNSOLVED; 8];
        let mut twice = [false; 8];
        let near = before.iter().filter(|q| !q[0].is_nan());
        for start in near.chain(&self.starts) {
            let Some(q) = self.solved(pose, start) else { continue };
            let slot = self.slot(&q);
            if found[slot][0].is_nan() {
                found[slot] = q;
            } else if !same(&found[slot], &q) {
                twice[slot] = true; // the bits do not tell them apart
            }
            if found.iter().all(|q| !q[0].is_nan()) {
                break;
            }
        }
        std::array::from_fn(|k| if twice[k] { UNSOLVED } else { found[k] })
    }

    /// Go from joint angles to a pose; None where that does not lead there.
    fn solved(&self, pose: &Pose, from: &Six) -> Option<Six> {
        let mut q = *from;
        for _ in 0..ROUNDS {
            let frames = self.chain.frames(&q);
            let (off, alike) = apart(pose, &frames[6].axes, &frames[6].origin);
            let size = off.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            if size < CLOSE && alike {
                return Some(q.map(|t| t - TAU * (t / TAU).round()));
            }
            let step = solve(self.columns(&frames), off)?;
            let most = step.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let scale = if most > STEP { STEP / most } else { 1.0 };
            q = std::array::from_fn(|j| q[j] + scale * step[j]);
        }
        None
    }

    /// Differentiate the flange by the joint angles: velocity and turn, joint by joint.
    fn columns(&self, frames: &[crate::chain::Frame; 7]) -> [Six; 6] {
        let place = frames[6].origin;
        self.chain.to_controller(&std::array::from_fn(|j| {
            let axis = &frames[j].axes[2];
            let [x, y, z] = cross(axis, &minus(&place, &frames[j].origin));
            [x, y, z, axis[0], axis[1], axis[2]]
        }))
    }

    /// Name a branch by what vanishes at its singularities: 4 where the sine of axis 5 is
    /// negative, 1 where the wrist comes nearer to axis 2 as axis 3 turns on, 2 by the sign
    /// of what is left of the determinant.
    pub fn slot(&self, q: &Six) -> usize {
        let frames = self.chain.frames(q);
        let wrist = self.chain.0[4].angle(q).sin();
        let (second, third) = (frames[1].axes[2], frames[2].axes[2]);
        let reach = minus(&frames[4].origin, &frames[1].origin);
        let up = dot(&reach, &second);
        let aside: Three = std::array::from_fn(|k| reach[k] - up * second[k]);
        let moved = cross(&third, &minus(&frames[4].origin, &frames[2].origin));
        let elbow = self.chain.0[2].sense * dot(&aside, &moved);
        let rest = determinant(self.columns(&frames)) * wrist.signum() * elbow.signum();
        4 * usize::from(wrist < 0.0) + 2 * usize::from(rest < 0.0) + usize::from(elbow < 0.0)
    }
}

const NEARBY: f64 = 0.5; // [rad] that Newton's method goes from one solution to the next
const NEARBY_ROUNDS: usize = 8;
const SINGULAR: f64 = 1e-6;
const LOOKED_AT: usize = 5; // places between two solutions

impl Numeric {
    /// Solve for the joint angles nearest to given ones: the solution that no singularity
    /// parts from them, else that of a branch on the nearest turn.
    pub fn nearest(&self, pose: &Pose, near: &Six, slot: usize) -> Six {
        if let Some(q) = self.reach(pose, near).filter(|q| self.is_regular(near, q)) {
            return q;
        }
        let unknown = pose.iter().any(|x| x.is_nan());
        let found = if unknown { UNSOLVED } else { self.branches(pose, &[UNSOLVED; 8])[slot] };
        std::array::from_fn(|j| near[j] + wrapped(found[j] - near[j]))
    }

    /// Go to a pose by Newton's method. An arm without a closed form can have 16 solutions,
    /// more than there are branches: the one that is near is found by going there.
    fn reach(&self, pose: &Pose, near: &Six) -> Option<Six> {
        let mut q = *near;
        for _ in 0..NEARBY_ROUNDS {
            let frames = self.chain.frames(&q);
            let (off, alike) = apart(pose, &frames[6].axes, &frames[6].origin);
            if alike && off.iter().all(|x| x.abs() < CLOSE) {
                return Some(q);
            }
            let columns = self.columns(&frames);
            if least_singular(columns) <= SINGULAR {
                return None;
            }
            let step = solve(columns, off)?;
            q = std::array::from_fn(|j| q[j] + step[j]);
            if !q.iter().zip(near).all(|(q, near)| (q - near).abs() < NEARBY) {
                return None;
            }
        }
        None
    }

    /// Tell whether no singularity lies between joint angles: branches meet there alone.
    fn is_regular(&self, start: &Six, end: &Six) -> bool {
        let sign = |k: usize| {
            let share = k as f64 / (LOOKED_AT - 1) as f64;
            let q: Six = std::array::from_fn(|j| start[j] + share * (end[j] - start[j]));
            determinant(self.columns(&self.chain.frames(&q))).partial_cmp(&0.0)
        };
        let first = sign(0);
        let one_sided = first.is_some_and(|side| side.is_ne());
        one_sided && (1..LOOKED_AT).all(|k| sign(k) == first)
    }
}

/// Return the smallest singular value, by turning pairs of columns until all are at right
/// angles to each other (Hestenes 1958).
fn least_singular(mut columns: [Six; 6]) -> f64 {
    let product = |a: &Six, b: &Six| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    for _ in 0..30 {
        let mut askew = 0.0_f64;
        for i in 0..5 {
            for j in i + 1..6 {
                let (a, b) = (columns[i], columns[j]);
                let (aa, bb, ab) = (product(&a, &a), product(&b, &b), product(&a, &b));
                askew = askew.max(ab.abs() / (aa * bb).sqrt().max(f64::MIN_POSITIVE));
                if ab == 0.0 {
                    continue;
                }
                let half = (bb - aa) / (2.0 * ab);
                let tan = half.signum() / (half.abs() + (1.0 + half * half).sqrt());
                let cos = 1.0 / (1.0 + tan * tan).sqrt();
                columns[i] = std::array::from_fn(|k| cos * (a[k] - tan * b[k]));
                columns[j] = std::array::from_fn(|k| cos * (b[k] + tan * a[k]));
            }
        }
        if askew < 1e-12 {
            break;
        }
    }
    columns.iter().map(|c| product(c, c).sqrt()).fold(f64::INFINITY, f64::min)
}

/// Wrap an angle into [-pi, pi).
pub fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

fn same(a: &Six, b: &Six) -> bool {
    a.iter().zip(b).all(|(a, b)| {
        let apart = a - b;
        (apart - TAU * (apart / TAU).round()).abs() < SAME
    })
}

/// From a flange to a pose: distance [m] and turn [rad], and whether it is no half turn.
fn apart(pose: &Pose, axes: &[Three; 3], origin: &Three) -> (Six, bool) {
    let mut turn = [0.0; 3];
    let mut trace = 0.0;
    for (j, axis) in axes.iter().enumerate() {
        let wanted = [pose[j], pose[4 + j], pose[8 + j]];
        let across = cross(axis, &wanted);
        for k in 0..3 {
            turn[k] += across[k] / 2.0;
        }
        trace += dot(axis, &wanted);
    }
    let off = |k: usize| pose[4 * k + 3] - origin[k];
    ([off(0), off(1), off(2), turn[0], turn[1], turn[2]], trace > 2.0)
}

/// Eliminate: the solution of sum_j columns[j] x_j = right, None where there is none.
pub fn solve(columns: [Six; 6], right: Six) -> Option<Six> {
    let mut rows: [[f64; 7]; 6] = std::array::from_fn(|i| {
        std::array::from_fn(|j| if j < 6 { columns[j][i] } else { right[i] })
    });
    eliminate(&mut rows)?;
    let mut x = [0.0; 6];
    for i in (0..6).rev() {
        let known: f64 = (i + 1..6).map(|j| rows[i][j] * x[j]).sum();
        x[i] = (rows[i][6] - known) / rows[i][i];
    }
    Some(x)
}

fn determinant(columns: [Six; 6]) -> f64 {
    let mut rows: [Six; 6] = std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]));
    match eliminate(&mut rows) {
        Some(sign) => (0..6).map(|i| rows[i][i]).product::<f64>() * sign,
        None => 0.0,
    }
}

/// Bring rows into triangular form; give the sign of their order, None where they depend
/// on each other.
fn eliminate<const K: usize>(rows: &mut [[f64; K]; 6]) -> Option<f64> {
    let mut sign = 1.0;
    for i in 0..6 {
        let pivot = (i..6).max_by(|a, b| rows[*a][i].abs().total_cmp(&rows[*b][i].abs()))?;
        if rows[pivot][i].abs() < 1e-12 {
            return None;
        }
        if pivot != i {
            rows.swap(pivot, i);
            sign = -sign;
        }
        let (above, below) = rows.split_at_mut(i + 1);
        for row in below {
            let share = row[i] / above[i][i];
            for (value, pivot) in row.iter_mut().zip(&above[i]) {
                *value -= share * pivot;
            }
        }
    }
    Some(sign)
}

/// Solve for all branches of every pose (n, 4, 4) [m]: (n, 8, 6) [rad], NaN where a
/// branch is not found.
#[pyfunction]
pub fn numeric_branches<'py>(
    py: Python<'py>,
    parameters: Parameters<'py>,
    flange: PyReadonlyArray3<'py, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (numeric, poses) = (Numeric::new(&parameters)?, poses(&flange)?);
    let mut before = [UNSOLVED; 8];
    let out = each(py, poses.len(), |i| {
        before = numeric.branches(&poses[i], &before);
        before
    })?;
    Ok(blocks(py, poses.len(), (8, 6), out.into_flattened().into_flattened()))
}
