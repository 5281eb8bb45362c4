//! Samples of paths whose fly points are rounded: `postproc.motion.blending`.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::corner::{Corner, Zones};
use crate::edges::{Edges, Paths};
use crate::rows::{array, each, flat, rows, same_length, Six};

/// `Corners` of the package.
#[derive(FromPyObject)]
pub struct Corners<'py> {
    zones: Zones<'py>,
    nearest: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
}

/// `_Pieces` of the package.
#[derive(FromPyObject)]
pub struct Pieces<'py> {
    corner: PyReadonlyArray2<'py, i64>,
    begin: PyReadonlyArray1<'py, f64>,
    end: PyReadonlyArray1<'py, f64>,
    count: PyReadonlyArray2<'py, i64>,
}

/// Samples, and their shares of their edges' ways.
struct Samples {
    path: Vec<Six>,
    share: Vec<f64>,
}

/// A corner, and where on it the path passes the fly point.
struct Rounded<'a> {
    corner: &'a Corner<'a>,
    nearest: f64,
    q: &'a Six,
}

impl Rounded<'_> {
    fn at(&self, s: f64) -> Six {
        if s == self.nearest {
            *self.q
        } else {
            self.corner.at(s)
        }
    }
}

impl Samples {
    fn push(&mut self, q: Six, share: f64) {
        self.path.push(q);
        self.share.push(share);
    }

    /// Follow the end of a corner: from its nearest point on.
    fn leave(&mut self, from: &Rounded<'_>, count: i64) {
        let step = (1.0 - from.nearest) / count as f64;
        for part in 1..=count {
            let s = from.nearest + part as f64 * step;
            self.push(from.at(s), 2.0 * from.corner.behind * step);
        }
    }

    /// Follow the begin of a corner: up to its nearest point.
    fn enter(&mut self, to: &Rounded<'_>, count: i64) {
        let step = to.nearest / count as f64;
        for part in 1..=count {
            let s = 0.0 + part as f64 * step;
            self.push(to.at(s), 2.0 * to.corner.before * step);
        }
    }
}

fn lost(what: &str) -> PyErr {
    PyIndexError::new_err(format!("{what} is not there"))
}

/// Sample all edges anew.
///
/// Args: the paths without corners and their samples' shares, joint angles at visits, the
/// corners, what edges are made of, and how many samples there will be.
///
/// Returns: samples (s, 6), and their shares (s,).
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn resampled<'py>(
    py: Python<'py>,
    edges: Edges<'py>,
    share: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    corners: Corners<'py>,
    pieces: Pieces<'py>,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>)> {
    let (paths, share) = (Paths::of(&edges, &q)?, flat(&share)?);
    let (all, nearest) = (corners.zones.corners(&paths)?, flat(&corners.nearest)?);
    let passed = rows::<6>(&corners.q)?;
    same_length(&[all.len(), nearest.len(), passed.len()])?;
    let (corner, count) = (flat(&pieces.corner)?, flat(&pieces.count)?);
    let (begin, end) = (flat(&pieces.begin)?, flat(&pieces.end)?);
    let e = same_length(&[begin.len(), end.len(), corner.len() / 2, count.len() / 3])?;
    let total = count.iter().sum::<i64>().max(0) as usize;
    let mut out = Samples { path: Vec::with_capacity(total), share: Vec::with_capacity(total) };
    let at = |c: i64| -> PyResult<Rounded<'_>> {
        let found = usize::try_from(c).ok().filter(|c| *c < all.len());
        let c = found.ok_or_else(|| lost("a corner"))?;
        Ok(Rounded { corner: &all[c], nearest: nearest[c], q: &passed[c] })
    };
    let mut sample = |i: usize| -> PyResult<()> {
        let (behind, ahead) = (corner[i], corner[e + i]);
        if behind < 0 && ahead < 0 {
            let kept = paths.span(i)?;
            out.path.extend_from_slice(paths.samples(kept.clone())?);
            let shares = share.get(kept);
            out.share.extend_from_slice(shares.ok_or_else(|| lost("a share"))?);
            return Ok(());
        }
        let (leaving, middle, entering) = (count[i], count[e + i], count[2 * e + i]);
        if leaving > 0 {
            out.leave(&at(behind)?, leaving);
        }
        if middle > 0 {
            let (way, long) = (paths.way(i as i64)?, (end[i] - begin[i]) / middle as f64);
            for part in 1..=middle {
                out.push(way.at(begin[i] + part as f64 * long), long);
            }
        }
        if entering > 0 {
            out.enter(&at(ahead)?, entering);
        }
        Ok(())
    };
    each(py, e, &mut sample)?.into_iter().collect::<PyResult<()>>()?;
    Ok((array(py, out.path), out.share.into_pyarray(py)))
}
