//! Places on the sampled paths of edges, for corners and deviations.

use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::rows::{flat, rows, Six};

/// `Edges` of the package.
#[derive(FromPyObject)]
pub struct Edges<'py> {
    path: PyReadonlyArray2<'py, f64>,
    start: PyReadonlyArray1<'py, i64>,
    source: PyReadonlyArray1<'py, i64>,
}

/// The paths between visits: samples of all, and joint angles at the visits.
pub struct Paths<'a> {
    path: &'a [Six],
    start: &'a [i64],
    source: &'a [i64],
    q: &'a [Six],
}

/// One way from visit to visit.
#[derive(Clone)]
pub struct Way<'a> {
    from: &'a Six,
    samples: &'a [Six],
}

impl<'a> Paths<'a> {
    pub fn of(edges: &'a Edges<'_>, q: &'a PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        Ok(Paths {
            path: rows(&edges.path)?,
            start: flat(&edges.start)?,
            source: flat(&edges.source)?,
            q: rows(q)?,
        })
    }

    /// Count the edges.
    pub fn len(&self) -> usize {
        self.source.len()
    }

    /// Return where an edge comes from, negative where that is not known.
    pub fn source(&self, edge: usize) -> i64 {
        self.source[edge]
    }

    /// Return the joint angles at a visit.
    pub fn visit(&self, visit: i64) -> PyResult<&'a Six> {
        let found = usize::try_from(visit).ok().and_then(|v| self.q.get(v));
        found.ok_or_else(|| PyIndexError::new_err(format!("there is no visit {visit}")))
    }

    /// Return an edge with its samples.
    pub fn way(&self, edge: i64) -> PyResult<Way<'a>> {
        let found = usize::try_from(edge).ok().and_then(|edge| self.find(edge));
        found.ok_or_else(|| PyIndexError::new_err(format!("edge {edge} leads from nowhere known")))
    }

    /// Tell where the samples of an edge stand.
    pub fn span(&self, edge: usize) -> PyResult<std::ops::Range<usize>> {
        let ends = || {
            let begin = usize::try_from(*self.start.get(edge)?).ok()?;
            Some(begin..usize::try_from(*self.start.get(edge + 1)?).ok()?)
        };
        ends().ok_or_else(|| PyIndexError::new_err(format!("there is no edge {edge}")))
    }

    /// Return some samples.
    pub fn samples(&self, span: std::ops::Range<usize>) -> PyResult<&'a [Six]> {
        self.path.get(span).ok_or_else(|| PyIndexError::new_err("samples that are not there"))
    }

    /// Return an edge with its samples; None where it leads from nowhere known.
    pub fn find(&self, edge: usize) -> Option<Way<'a>> {
        let samples = self.path.get(self.span(edge).ok()?).filter(|s| !s.is_empty())?;
        let source = usize::try_from(*self.source.get(edge)?).ok()?;
        Some(Way { from: self.q.get(source)?, samples })
    }
}

impl Way<'_> {
    pub fn count(&self) -> usize {
        self.samples.len()
    }

    /// Tell what joints turn by up to the first sample.
    pub fn turn(&self) -> Six {
        std::array::from_fn(|j| self.samples[0][j] - self.from[j])
    }

    /// Interpolate at the fraction u < 1 between the samples before and behind.
    pub fn straight_at(&self, u: f64) -> Six {
        let place = u * self.samples.len() as f64;
        let before = place.floor();
        let i = (before as usize).min(self.samples.len() - 1);
        let begin = if i == 0 { self.from } else { &self.samples[i - 1] };
        let end = &self.samples[i];
        std::array::from_fn(|j| begin[j] + (place - before) * (end[j] - begin[j]))
    }

    /// Interpolate at the fraction u: straight, or a parabola through three samples.
    pub fn at(&self, u: f64) -> Six {
        if let [end] = self.samples {
            return std::array::from_fn(|j| end[j] + (u - 1.0) * (end[j] - self.from[j]));
        }
        let count = self.samples.len();
        let x = u * count as f64;
        let middle = x.round_ties_even().clamp(1.0, (count - 1) as f64);
        let (i, t) = ((middle as usize).max(1), x - middle); // NaN is no place

        let before = if i == 1 { self.from } else { &self.samples[i - 2] };
        let (here, after) = (&self.samples[i - 1], &self.samples[i]);
        std::array::from_fn(|j| {
            let bend = after[j] - 2.0 * here[j] + before[j];
            let slope = (after[j] - before[j]) / 2.0;
            here[j] + t * slope + t * t / 2.0 * bend
        })
    }
}
