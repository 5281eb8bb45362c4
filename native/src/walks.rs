//! Ways between visits and what passing them does to plays: `postproc.robot.backlash_operator`.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::play::{ends, Clamp, Ends};
use crate::rows::{array, each, flat, row, rows, same_length, Six};

/// Walk through the samples start[i] .. start[i + 1] of each edge.
fn samples<'a>(values: &'a [Six], start: &[i64]) -> PyResult<Vec<&'a [Six]>> {
    let of = |pair: &[i64]| {
        let span = usize::try_from(pair[0]).ok()?..usize::try_from(pair[1]).ok()?;
        values.get(span)
    };
    let found: Option<Vec<&[Six]>> = start.windows(2).map(of).collect();
    found.ok_or_else(|| PyIndexError::new_err("edges with samples that are not there"))
}

/// Compose the clamps of passing each edge, (e, 6).
#[pyfunction]
pub fn clamps<'py>(
    py: Python<'py>,
    values: PyReadonlyArray2<'py, f64>,
    start: PyReadonlyArray1<'py, i64>,
    half: PyReadonlyArray1<'py, f64>,
) -> PyResult<Ends<'py>> {
    let half = row(&half)?;
    let all = samples(rows::<6>(&values)?, flat(&start)?)?;
    let along = |edge: &&[Six]| {
        let steps = edge.iter().map(|q| Clamp::passing(q, &half));
        steps.reduce(|before, step| before.then(&step)).unwrap_or(Clamp::IDENTITY)
    };
    Ok(ends(py, &each(py, all.len(), |edge| along(&all[edge]))?))
}

/// Put turning values into samples.
struct Refined {
    out: Vec<Six>,
    start: Vec<i64>,
}

impl Refined {
    /// Take the samples of an edge, from a known place or an unknown one.
    fn add(&mut self, edge: &[Six], from: Option<&Six>, uneven: &[bool]) {
        for (i, middle) in edge.iter().enumerate() {
            let behind = if i == 0 { from } else { Some(&edge[i - 1]) };
            match (behind, edge.get(i + 1), uneven[i]) {
                (Some(behind), Some(ahead), false) => self.turn(behind, middle, ahead),
                _ => self.out.push(*middle),
            }
        }
        self.start.push(self.out.len() as i64);
    }

    /// Take a sample, and the values where joints turn back next to it.
    fn turn(&mut self, behind: &Six, middle: &Six, ahead: &Six) {
        let (mut early, mut late) = (*middle, *middle);
        let (mut is_early, mut is_late) = (false, false);
        for j in 0..6 {
            let (rise, bend) =
                ((ahead[j] - behind[j]) / 2.0, (ahead[j] + behind[j]) / 2.0 - middle[j]);
            if rise.abs() < 2.0 * bend.abs() && rise != 0.0 {
                let value = middle[j] - rise * rise / (4.0 * bend);
                if (rise > 0.0) != (bend > 0.0) {
                    (late[j], is_late) = (value, true);
                } else {
                    (early[j], is_early) = (value, true);
                }
            }
        }
        self.out.extend(is_early.then_some(early));
        self.out.push(*middle);
        self.out.extend(is_late.then_some(late));
    }
}

/// Insert turning values inside every edge from a known place.
///
/// Returns: samples (s, 6), and where those of each edge begin, (e + 1,).
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn refined<'py>(
    py: Python<'py>,
    angles: PyReadonlyArray2<'py, f64>,
    source: PyReadonlyArray1<'py, i64>,
    values: PyReadonlyArray2<'py, f64>,
    start: PyReadonlyArray1<'py, i64>,
    uneven: PyReadonlyArray1<'py, i64>,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<i64>>)> {
    let (angles, values) = (rows::<6>(&angles)?, rows::<6>(&values)?);
    let (source, start) = (flat(&source)?, flat(&start)?);
    same_length(&[source.len() + 1, start.len()])?;
    let mut marked = vec![false; values.len()];
    for sample in flat(&uneven)? {
        let found = usize::try_from(*sample).ok().and_then(|s| marked.get_mut(s));
        *found.ok_or_else(|| PyIndexError::new_err("an uneven sample is not there"))? = true;
    }
    let mut refined = Refined { out: Vec::with_capacity(values.len()), start: vec![0] };
    let edges = samples(values, start)?;
    each(py, edges.len(), |i| {
        let from = usize::try_from(source[i]).ok().and_then(|v| angles.get(v));
        let begin = start[i] as usize;
        refined.add(edges[i], from, &marked[begin..begin + edges[i].len()]);
    })?;
    Ok((array(py, refined.out), refined.start.into_pyarray(py)))
}
