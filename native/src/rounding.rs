//! Samples of paths whose fly points are rounded: `postproc.motion.blending`.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::corner::{is_flat, Corner, Zones};
use crate::edges::{Edges, Paths, Way};
use crate::rows::{array, each, flat, rows, same_length, Six};

const EMPTY: f64 = 1e-9; // part of a move between two zones that is nothing

/// `Corners` of the package.
#[derive(FromPyObject)]
pub struct Corners<'py> {
    zones: Zones<'py>,
    nearest: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    bend: PyReadonlyArray2<'py, f64>,
}

/// Samples, and their shares of their edges' ways.
#[derive(Default)]
struct Samples {
    path: Vec<Six>,
    share: Vec<f64>,
    start: Vec<i64>,
    uneven: Vec<i64>,
    /// On each side of the nearest point of a corner that is not flat.
    most: usize,
}

/// A corner, and where on it the path passes the fly point.
struct Rounded<'a> {
    corner: Corner<'a>,
    nearest: f64,
    q: &'a Six,
    /// The nearest point alone tells of it.
    flat: bool,
    /// No drive turns back on it, between straight moves.
    goes_on: bool,
}

impl Rounded<'_> {
    fn at(&self, s: f64) -> Six {
        if s == self.nearest {
            *self.q
        } else {
            self.corner.at(s)
        }
    }

    /// Count its samples before the nearest point, and behind it, of so many on each side.
    fn counts(&self, most: usize) -> (usize, usize) {
        if self.flat {
            (1, 0)
        } else {
            (most, most)
        }
    }
}

impl Samples {
    fn push(&mut self, q: Six, share: f64) {
        self.path.push(q);
        self.share.push(share);
    }

    /// Follow the end of a corner: from its nearest point on.
    fn leave(&mut self, from: &Rounded<'_>, count: usize) {
        let step = (1.0 - from.nearest) / count as f64;
        for part in 1..=count {
            let s = from.nearest + part as f64 * step;
            self.push(from.at(s), 2.0 * from.corner.behind * step);
        }
    }

    /// Follow the begin of a corner: up to its nearest point.
    fn enter(&mut self, to: &Rounded<'_>, count: usize) {
        let step = to.nearest / count as f64;
        for part in 1..=count {
            let s = 0.0 + part as f64 * step;
            self.push(to.at(s), 2.0 * to.corner.before * step);
        }
    }

    /// Mark the last sample as one whose neighbours are not equally far along the path.
    fn part(&mut self) {
        let last = self.path.len() as i64 - 1;
        if self.uneven.last() != Some(&last) {
            self.uneven.push(last);
        }
    }

    /// Follow an edge between two corners, of which there is one at least.
    fn follow(&mut self, way: &Way<'_>, behind: Option<&Rounded<'_>>, ahead: Option<&Rounded<'_>>) {
        let leaving = behind.map_or(0, |corner| corner.counts(self.most).1);
        let begin = behind.map_or(0.0, |corner| corner.corner.behind);
        let end = ahead.map_or(1.0, |corner| 1.0 - corner.corner.before);
        if let Some(from) = behind.filter(|_| leaving > 0) {
            self.leave(from, leaving);
            self.part();
        } else if behind.is_some() {
            self.uneven.push(self.path.len() as i64);
        }
        let middle = way.count_between(begin, end);
        if middle > 0 {
            let long = (end - begin) / middle as f64;
            for part in 1..=middle {
                self.push(way.at(begin + part as f64 * long), long);
            }
            self.part();
        }
        if let Some(to) = ahead {
            self.enter(to, to.counts(self.most).0);
        }
    }
}

impl Way<'_> {
    /// Count the samples of a part of the way.
    fn count_between(&self, begin: f64, end: f64) -> usize {
        if end - begin > EMPTY {
            let count = self.count();
            ((count as f64 * (end - begin) - EMPTY).ceil() as usize).min(count)
        } else {
            0
        }
    }
}

/// Rounds the paths of a program.
struct Rounding<'a> {
    paths: Paths<'a>,
    share: &'a [f64],
    corners: Vec<Rounded<'a>>,
    /// The corners at the begin and at the end of every edge.
    at: Vec<[Option<usize>; 2]>,
    /// Edges on which no drive turns are sampled where they end alone.
    few: bool,
}

impl Rounding<'_> {
    fn sample(&self, edge: usize, out: &mut Samples) -> PyResult<()> {
        let [behind, ahead] = self.at[edge].map(|c| c.map(|c| &self.corners[c]));
        match (behind, ahead) {
            (None, None) => {
                let kept = self.paths.span(edge)?;
                out.path.extend_from_slice(self.paths.samples(kept.clone())?);
                let lost = || PyIndexError::new_err("a share is not there");
                out.share.extend_from_slice(self.share.get(kept).ok_or_else(lost)?);
            }
            (behind, Some(to))
                if self.few && to.goes_on && behind.is_none_or(|corner| corner.goes_on) =>
            {
                if behind.is_some() {
                    out.uneven.push(out.path.len() as i64);
                }
                out.enter(to, 1);
            }
            _ => out.follow(&self.paths.way(edge as i64)?, behind, ahead),
        }
        out.start.push(out.path.len() as i64);
        Ok(())
    }
}

/// Sample all edges anew.
///
/// Args: the paths without corners and their samples' shares, joint angles at visits, the
/// corners; where edges on which no drive turns need no samples between, what drives do as
/// joints turn, (6, 6); samples on each side of the nearest point of a corner that is not flat.
///
/// Returns: samples (s, 6), their shares (s,), where those of each edge begin (e + 1,), and
/// the samples whose neighbours are not equally far along the path.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn rounded<'py>(
    py: Python<'py>,
    edges: Edges<'py>,
    share: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    corners: Corners<'py>,
    coupling: Option<PyReadonlyArray2<'py, f64>>,
    most: usize,
) -> PyResult<(
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
)> {
    let (paths, share) = (Paths::of(&edges, &q)?, flat(&share)?);
    let drives = coupling.as_ref().map(rows::<6>).transpose()?;
    let (all, nearest) = (corners.zones.corners(&paths)?, flat(&corners.nearest)?);
    let (passed, bend) = (rows::<6>(&corners.q)?, rows::<6>(&corners.bend)?);
    same_length(&[all.len(), nearest.len(), passed.len(), bend.len()])?;
    let mut at = vec![[None; 2]; paths.len()];
    for (c, (into, out)) in corners.zones.edges()?.enumerate() {
        (at[into][1], at[out][0]) = (Some(c), Some(c));
    }
    let few = drives.is_some();
    let mut corners = Vec::with_capacity(all.len());
    for (c, corner) in all.into_iter().enumerate() {
        corners.push(Rounded {
            nearest: nearest[c],
            q: &passed[c],
            flat: is_flat(&bend[c]),
            goes_on: drives.is_some_and(|drives| corner.goes_on(drives)),
            corner,
        });
    }
    let work = Rounding { paths, share, corners, at, few };
    let mut out = Samples { start: vec![0], most, ..Samples::default() };
    each(py, work.at.len(), |edge| work.sample(edge, &mut out))?
        .into_iter()
        .collect::<PyResult<()>>()?;
    let shares = out.share.into_pyarray(py);
    Ok((array(py, out.path), shares, out.start.into_pyarray(py), out.uneven.into_pyarray(py)))
}
