//! How the path runs round fly points: `postproc.motion.blending`.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::chain::{Chain, Parameters};
use crate::edges::{Edges, Paths, Way};
use crate::rows::{array, dot, each, flat, minus, rows, same_length, Six, Three};

const GRID: usize = 8; // steps of the first search for the nearest point
const ROUNDS: usize = 5; // of Newton's method
const FLAT: f64 = 4e-5; // [rad] bend below which moves are as good as straight
const REFINED: usize = 2; // rounds for the others
const STEP: f64 = 0.02; // in s

/// `Zones` of the package.
#[derive(FromPyObject)]
pub struct Zones<'py> {
    visit: PyReadonlyArray1<'py, i64>,
    into: PyReadonlyArray1<'py, i64>,
    out: PyReadonlyArray1<'py, i64>,
    before: PyReadonlyArray1<'py, f64>,
    behind: PyReadonlyArray1<'py, f64>,
}

/// Two moves that are superposed.
pub struct Corner<'a> {
    into: Way<'a>,
    out: Way<'a>,
    here: &'a Six,
    pub before: f64,
    pub behind: f64,
}

/// Where the path passes a corner.
struct Passed {
    before: f64,
    behind: f64,
    nearest: f64,
    q: Six,
    aside: Three,
    bend: Six,
}

/// What the nearest point is looked for with: the TCP at a place, seen from the point.
struct Look<'a> {
    chain: &'a Chain,
    tool: &'a Three,
    point: &'a Three,
}

impl Zones<'_> {
    /// Look up the moves at the corners.
    pub fn corners<'a>(&self, paths: &Paths<'a>) -> PyResult<Vec<Corner<'a>>> {
        let (visit, into, out) = (flat(&self.visit)?, flat(&self.into)?, flat(&self.out)?);
        let (before, behind) = (flat(&self.before)?, flat(&self.behind)?);
        let n = same_length(&[visit.len(), into.len(), out.len(), before.len(), behind.len()])?;
        let corner = |c: usize| {
            Ok(Corner {
                into: paths.way(into[c])?,
                out: paths.way(out[c])?,
                here: paths.visit(visit[c])?,
                before: before[c],
                behind: behind[c],
            })
        };
        (0..n).map(corner).collect()
    }
}

impl Look<'_> {
    fn off(&self, q: &Six) -> Three {
        minus(&self.chain.placed(q, self.tool), self.point)
    }
}

impl Corner<'_> {
    /// Follow the superposed moves, s from 0 to 1.
    pub fn at(&self, s: f64) -> Six {
        let into = self.into.at(1.0 - self.before * (1.0 - s) * (1.0 - s));
        let out = self.out.at(self.behind * s * s);
        std::array::from_fn(|j| into[j] + out[j] - self.here[j])
    }

    /// Find where the path passes the point within a distance: a smaller zone if need be.
    fn pass(&mut self, look: &Look<'_>, within: f64) -> Passed {
        let (mut bend, mut nearest, miss) = self.passing(look);
        if miss > within {
            let shrink = within / miss.max(1e-12);
            self.before *= shrink;
            self.behind *= shrink;
            (bend, nearest, _) = self.passing(look);
        }
        if bend.iter().any(|b| b.abs() >= FLAT || b.is_nan()) {
            nearest = self.refined(nearest, look);
        }
        let q = self.at(nearest);
        let (before, behind) = (self.before, self.behind);
        Passed { before, behind, nearest, q, aside: look.off(&q), bend }
    }

    /// Find how much the corner bends, where it passes closest, and how far off.
    fn passing(&self, look: &Look<'_>) -> (Six, f64, f64) {
        let (first, last) = (self.into.at(1.0 - self.before), self.out.at(self.behind));
        let (begin, end) = (look.off(&first), look.off(&last));
        let s = nearest_on_parabola(&begin, &end);
        let off = on_parabola(&begin, &end, s);
        let bend = std::array::from_fn(|j| first[j] + last[j] - 2.0 * self.here[j]);
        (bend, s, dot(&off, &off).sqrt())
    }

    /// Improve the nearest point where the moves are not straight.
    fn refined(&self, mut s: f64, look: &Look<'_>) -> f64 {
        for _ in 0..REFINED {
            s = s.clamp(STEP, 1.0 - STEP);
            let [before, x, after] = [s - STEP, s, s + STEP].map(|s| look.off(&self.at(s)));
            let slope = std::array::from_fn(|k| (after[k] - before[k]) / 2.0);
            let curve = std::array::from_fn(|k| after[k] - 2.0 * x[k] + before[k]);
            let curved = dot(&slope, &slope) + dot(&x, &curve);
            if curved > 0.0 {
                s -= STEP * dot(&x, &slope) / curved;
            }
        }
        s.clamp(0.0, 1.0)
    }
}

fn on_parabola(b: &Three, e: &Three, s: f64) -> Three {
    std::array::from_fn(|k| b[k] * (1.0 - s) * (1.0 - s) + e[k] * s * s)
}

/// Find the s at which begin (1 - s)^2 + end s^2 is shortest.
fn nearest_on_parabola(b: &Three, e: &Three) -> f64 {
    let (mut s, mut least) = (0.0, f64::INFINITY);
    for i in 0..=GRID {
        let at = i as f64 / GRID as f64;
        let x = on_parabola(b, e, at);
        let away = dot(&x, &x).sqrt();
        if away < least {
            (s, least) = (at, away);
        }
    }
    let bend: Three = std::array::from_fn(|k| 2.0 * (b[k] + e[k]));
    for _ in 0..ROUNDS {
        let x = on_parabola(b, e, s);
        let slope: Three = std::array::from_fn(|k| 2.0 * (e[k] * s - b[k] * (1.0 - s)));
        let curved = dot(&slope, &slope) + dot(&x, &bend);
        if curved > 0.0 {
            s = (s - dot(&x, &slope) / curved).clamp(0.0, 1.0);
        }
    }
    s
}

type Column<'py> = Bound<'py, PyArray1<f64>>;
type Block<'py> = Bound<'py, PyArray2<f64>>;

/// Find where the path passes c corners, `within` a distance [m] of their points.
///
/// Returns: before, behind, nearest (c,), q (c, 6), aside (c, 3), bend (c, 6).
#[pyfunction]
#[allow(clippy::too_many_arguments, clippy::type_complexity)]
pub fn passed<'py>(
    py: Python<'py>,
    parameters: Parameters<'py>,
    edges: Edges<'py>,
    q: PyReadonlyArray2<'py, f64>,
    zones: Zones<'py>,
    tool: PyReadonlyArray2<'py, f64>,
    point: PyReadonlyArray2<'py, f64>,
    within: PyReadonlyArray1<'py, f64>,
) -> PyResult<(Column<'py>, Column<'py>, Column<'py>, Block<'py>, Block<'py>, Block<'py>)> {
    let (chain, paths) = (Chain::new(&parameters)?, Paths::of(&edges, &q)?);
    let (tool, point, within) = (rows::<3>(&tool)?, rows::<3>(&point)?, flat(&within)?);
    let mut corners = zones.corners(&paths)?;
    let n = same_length(&[corners.len(), tool.len(), point.len(), within.len()])?;
    let found = each(py, n, |c| {
        let look = Look { chain: &chain, tool: &tool[c], point: &point[c] };
        corners[c].pass(&look, within[c])
    })?;
    let column = |value: fn(&Passed) -> f64| -> Column<'py> {
        found.iter().map(value).collect::<Vec<_>>().into_pyarray(py)
    };
    Ok((
        column(|p| p.before),
        column(|p| p.behind),
        column(|p| p.nearest),
        array(py, found.iter().map(|p| p.q).collect()),
        array(py, found.iter().map(|p| p.aside).collect()),
        array(py, found.iter().map(|p| p.bend).collect()),
    ))
}

#[cfg(test)]
mod tests {
    use super::{dot, nearest_on_parabola, on_parabola, Three};

    #[test]
    fn the_nearest_point_is_as_near_as_a_fine_search_finds() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        for _ in 0..200 {
            let [b, e]: [Three; 2] =
                [[random(), random(), random()], [random(), random(), random()]];
            let away = |s: f64| dot(&on_parabola(&b, &e, s), &on_parabola(&b, &e, s)).sqrt();
            let least =
                (0..=20_000).map(|i| away(f64::from(i) / 20_000.0)).fold(f64::INFINITY, f64::min);
            assert!(away(nearest_on_parabola(&b, &e)) < least + 1e-5 * least + 1e-6);
        }
    }
}
