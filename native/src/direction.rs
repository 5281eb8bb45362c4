//! From which side joints arrive: `postproc.robot.direction`.

use std::collections::VecDeque;

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::play::{ends, Clamp, Clamps, Ends};
use crate::rows::{array, detached, each, flat, row, rows, same_length, Six};

const ON_FLANK: f64 = 0.999; // of half the width: as good as resting on the flank

/// `Chains` of the package.
#[derive(FromPyObject)]
pub struct Chains<'py> {
    angles: PyReadonlyArray2<'py, f64>,
    first: PyReadonlyArray1<'py, i64>,
    source: PyReadonlyArray1<'py, i64>,
    heads: PyReadonlyArray1<'py, i64>,
    ends: PyReadonlyArray1<'py, i64>,
    chain_of: PyReadonlyArray1<'py, i64>,
}

/// A graph of visits, and what is known of it.
struct Graph<'a> {
    angles: &'a [Six],
    first: &'a [i64],
    source: &'a [i64],
    heads: &'a [i64],
    chain_of: &'a [i64],
    /// The clamps of every edge alone.
    own: Vec<Clamp>,
    /// From each visit's chain head, not included, to the visit.
    since_head: Vec<Clamp>,
    half: Six,
    /// The state at every head, as far as it is known.
    known: Vec<Option<Clamp>>,
}

impl Graph<'_> {
    /// Tell whether all that is referred to is there: nothing below looks again.
    fn is_sound(&self, chain_ends: &[i64]) -> bool {
        let (n, e) = (self.angles.len() as i64, self.own.len() as i64);
        let (chains, spans) = (self.heads.len() as i64, self.heads.iter().zip(chain_ends));
        let bodies = spans.clone().flat_map(|(head, end)| head + 1..*end);
        self.first.len() as i64 == n + 1
            && self.first.iter().all(|edge| (0..=e).contains(edge))
            && self.source.len() as i64 == e
            && self.source.iter().all(|visit| *visit < n)
            && self.heads.len() == chain_ends.len()
            && spans.clone().all(|(head, end)| 0 <= *head && head < end && *end <= n)
            && bodies.into_iter().all(|visit| self.first[visit as usize] < e)
            && self.chain_of.len() as i64 == n
            && self.chain_of.iter().all(|chain| (0..chains).contains(chain))
    }

    fn edges_to(&self, visit: usize) -> std::ops::Range<usize> {
        self.first[visit] as usize..self.first[visit + 1] as usize
    }

    /// Compose the clamps from each chain's head to its visits.
    fn compose(&mut self, py: Python<'_>, chain_ends: &[i64]) -> PyResult<()> {
        for (head, end) in self.heads.iter().zip(chain_ends) {
            let first = *head as usize + 1;
            each(py, *end as usize - first, |i| {
                let visit = first + i;
                let step = self.own[self.first[visit] as usize];
                let before = self.since_head[visit - 1];
                self.since_head[visit] = if i == 0 { step } else { before.then(&step) };
            })?;
        }
        Ok(())
    }

    /// List, for each chain, the chains whose head is reached from it.
    fn followers(&self) -> Vec<Vec<usize>> {
        let mut out = vec![Vec::new(); self.heads.len()];
        for (c, head) in self.heads.iter().enumerate() {
            for edge in self.edges_to(*head as usize) {
                if self.source[edge] >= 0 {
                    out[self.chain_of[self.source[edge] as usize] as usize].push(c);
                }
            }
        }
        out
    }

    /// Take the hull of what arrives at a head; None while nothing is known to.
    fn at_head(&self, c: usize) -> Option<Clamp> {
        let head = self.heads[c] as usize;
        let mut found: Option<Clamp> = None;
        for edge in self.edges_to(head) {
            if self.source[edge] < 0 {
                return Some(Clamp::passing(&self.angles[head], &self.half));
            }
            let source = self.source[edge] as usize;
            if let Some(before) = self.known[self.chain_of[source] as usize] {
                let arrived = before.then(&self.since_head[source]).then(&self.own[edge]);
                found = Some(found.map_or(arrived, |other| other.hull(&arrived)));
            }
        }
        found
    }

    /// Find what is known at the heads: intervals only grow, so the list runs dry.
    fn settle(&mut self, py: Python<'_>, given: Option<Clamp>) -> PyResult<()> {
        let followers = self.followers();
        let mut waiting: VecDeque<usize> = (0..self.heads.len()).collect();
        let mut queued = vec![true; self.heads.len()];
        while !waiting.is_empty() {
            each(py, waiting.len(), |_| {
                let c = waiting.pop_front().expect("as many as there were");
                queued[c] = false;
                let new = if c == 0 && given.is_some() { given } else { self.at_head(c) };
                if new.is_none() || same(&self.known[c], &new) {
                    return;
                }
                self.known[c] = new;
                for follower in &followers[c] {
                    if !queued[*follower] {
                        queued[*follower] = true;
                        waiting.push_back(*follower);
                    }
                }
            })?;
        }
        Ok(())
    }

    /// Carry what is known at the heads on to all visits; the others know nothing.
    fn states(&self, py: Python<'_>) -> PyResult<Vec<Clamp>> {
        each(py, self.angles.len(), |visit| match self.known[self.chain_of[visit] as usize] {
            Some(known) => known.then(&self.since_head[visit]),
            None => Clamp::passing(&self.angles[visit], &self.half),
        })
    }
}

/// NaN equals NaN.
fn equal(a: &Six, b: &Six) -> bool {
    a.iter().zip(b).all(|(a, b)| a == b || (a.is_nan() && b.is_nan()))
}

fn same(a: &Option<Clamp>, b: &Option<Clamp>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => equal(&a.lo, &b.lo) && equal(&a.hi, &b.hi),
        _ => false,
    }
}

/// Find what is known of the play's state at every visit, as intervals (n, 6).
#[pyfunction]
pub fn states<'py>(
    py: Python<'py>,
    chains: Chains<'py>,
    own: Clamps<'py>,
    half: PyReadonlyArray1<'py, f64>,
    before: Clamps<'py>,
) -> PyResult<Ends<'py>> {
    let (angles, half) = (rows::<6>(&chains.angles)?, row(&half)?);
    let mut graph = Graph {
        angles,
        first: flat(&chains.first)?,
        source: flat(&chains.source)?,
        heads: flat(&chains.heads)?,
        chain_of: flat(&chains.chain_of)?,
        own: own.list()?,
        since_head: vec![Clamp::IDENTITY; angles.len()],
        half,
        known: vec![None; flat(&chains.heads)?.len()],
    };
    let chain_ends = flat(&chains.ends)?;
    if !detached(py, || graph.is_sound(chain_ends))? {
        return Err(PyIndexError::new_err("chains of visits or edges that are not there"));
    }
    graph.compose(py, chain_ends)?;
    graph.settle(py, before.list()?.first().copied())?;
    Ok(ends(py, &graph.states(py)?))
}

/// Place a joint in its play, whose state lies between two ends; 0 where that tells nothing.
pub fn place_in_play(angle: f64, lo: f64, hi: f64, half: f64) -> f64 {
    let s = ((angle - (lo + hi) / 2.0) / half).clamp(-1.0, 1.0);
    if s.abs() > ON_FLANK {
        s.signum()
    } else if hi - lo < half / 2.0 && !s.is_nan() {
        s
    } else {
        0.0
    }
}

/// Place every joint in its play, (n, 6).
#[pyfunction]
pub fn side<'py>(
    py: Python<'py>,
    angles: PyReadonlyArray2<'py, f64>,
    z: Clamps<'py>,
    half: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (angles, z, half) = (rows::<6>(&angles)?, z.list()?, row(&half)?);
    same_length(&[angles.len(), z.len()])?;
    let sides = each(py, angles.len(), |i| -> Six {
        std::array::from_fn(|j| place_in_play(angles[i][j], z[i].lo[j], z[i].hi[j], half[j]))
    });
    Ok(array(py, sides?))
}
