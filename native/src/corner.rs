//! How the path runs round fly points: `postproc.motion.blending`.

use std::ops::Range;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::chain::{Chain, Parameters};
use crate::edges::{Edges, Paths, Way};
use crate::rows::{array, flat, in_parts, rows, same_length, Lanes, Six, Three, SIDE, WORTH};

const GRID: usize = 8; // steps of the first search for the nearest point
const ROUNDS: usize = 5; // of Newton's method
const FLAT: f64 = 4e-5; // [rad] bend below which moves are as good as straight
const REFINED: usize = 2; // rounds for the others
const STEP: f64 = 0.02; // in s
const SHORT: f64 = 1e-12; // [m] a way that leads nowhere

/// `Zones` of the package.
#[derive(FromPyObject)]
pub struct Zones<'py> {
    visit: PyReadonlyArray1<'py, i64>,
    into: PyReadonlyArray1<'py, i64>,
    out: PyReadonlyArray1<'py, i64>,
    before: PyReadonlyArray1<'py, f64>,
    behind: PyReadonlyArray1<'py, f64>,
}

/// Tell whether a bend is so small that moves are as good as straight.
pub fn is_flat(bend: &Six) -> bool {
    bend.iter().all(|bend| bend.abs() < FLAT)
}

/// Two moves that are superposed.
#[derive(Clone)]
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
    along: Three,
    bend: Six,
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

    /// List the edges into the corners, and those out of them.
    pub fn edges(&self) -> PyResult<impl Iterator<Item = (usize, usize)> + '_> {
        let (into, out) = (flat(&self.into)?, flat(&self.out)?);
        Ok(into.iter().zip(out).map(|(into, out)| (*into as usize, *out as usize)))
    }
}

impl Corner<'_> {
    /// Tell whether every drive goes on from a straight move in another one.
    pub fn goes_on(&self, drives: &[Six]) -> bool {
        if self.into.count() != 1 || self.out.count() != 1 {
            return false;
        }
        let (into, out) = (self.into.turn(), self.out.turn());
        let turned = |drive: &Six, turns: &Six| -> f64 {
            drive.iter().zip(turns).map(|(share, turn)| share * turn).sum()
        };
        !drives.iter().any(|drive| turned(drive, &into) * turned(drive, &out) < 0.0)
    }

    /// Follow the superposed moves, s from 0 to 1.
    pub fn at(&self, s: f64) -> Six {
        let into = self.into.at(1.0 - self.before * (1.0 - s) * (1.0 - s));
        let out = self.out.at(self.behind * s * s);
        std::array::from_fn(|j| into[j] + out[j] - self.here[j])
    }

    /// Follow the moves to where the zone begins and from where it ends.
    fn ends(&self) -> [Six; 2] {
        [self.into.at(1.0 - self.before), self.out.at(self.behind)]
    }

    /// Tell how much the corner bends.
    fn bend(&self) -> Six {
        let [first, last] = self.ends();
        std::array::from_fn(|j| first[j] + last[j] - 2.0 * self.here[j])
    }
}

/// Up to `SIDE` corners whose nearest points are looked for side by side.
struct Group<'a, 'b> {
    chain: &'b Chain,
    corners: &'b mut [Corner<'a>],
    tool: [Lanes; 3],
    point: [Lanes; 3],
}

impl<'a, 'b> Group<'a, 'b> {
    fn new(
        chain: &'b Chain,
        corners: &'b mut [Corner<'a>],
        tool: &[Three],
        point: &[Three],
    ) -> Self {
        let (tool, point) = (side_by_side(tool), side_by_side(point));
        Group { chain, corners, tool, point }
    }

    /// Place the TCP, seen from the points.
    #[inline(always)]
    fn off(&self, q: &[Lanes; 6]) -> [Lanes; 3] {
        let mut off = self.chain.placed_side_by_side(q, &self.tool);
        for (off, point) in off.iter_mut().zip(&self.point) {
            for lane in 0..SIDE {
                off[lane] -= point[lane];
            }
        }
        off
    }

    /// Place the TCP on the corners.
    #[inline(always)]
    fn off_at(&self, s: &Lanes) -> [Lanes; 3] {
        let mut q = [[0.0; SIDE]; 6];
        for (lane, corner) in self.corners.iter().enumerate() {
            put(&mut q, lane, &corner.at(s[lane]));
        }
        self.off(&q)
    }

    /// Find where the paths pass their points within a distance: a smaller zone if need be.
    #[inline(always)]
    fn pass(&mut self, within: &[f64]) -> ([Six; SIDE], Lanes, [Lanes; 3], [Lanes; 3]) {
        let (mut nearest, miss, mut ends) = self.passing();
        let mut shrunk = false;
        for (lane, corner) in self.corners.iter_mut().enumerate() {
            if miss[lane] > within[lane] {
                let shrink = within[lane] / miss[lane].max(1e-12);
                corner.before *= shrink;
                corner.behind *= shrink;
                shrunk = true;
            }
        }
        if shrunk {
            (nearest, _, ends) = self.passing();
        }
        let mut bend = [[0.0; 6]; SIDE];
        for (bend, corner) in bend.iter_mut().zip(self.corners.iter()) {
            *bend = corner.bend();
        }
        let bent = bend.map(|own| !is_flat(&own));
        if bent.contains(&true) {
            let refined = self.refined(nearest);
            nearest = std::array::from_fn(|k| if bent[k] { refined[k] } else { nearest[k] });
        }
        (bend, nearest, self.off_at(&nearest), along_parabola(&ends[0], &ends[1], &nearest))
    }

    /// Find where the corners pass closest, how far off, and both of their ends.
    #[inline(always)]
    fn passing(&self) -> (Lanes, Lanes, [[Lanes; 3]; 2]) {
        let (mut first, mut last) = ([[0.0; SIDE]; 6], [[0.0; SIDE]; 6]);
        for (lane, corner) in self.corners.iter().enumerate() {
            let ends = corner.ends();
            put(&mut first, lane, &ends[0]);
            put(&mut last, lane, &ends[1]);
        }
        let (begin, end) = (self.off(&first), self.off(&last));
        let s = nearest_on_parabola(&begin, &end);
        (s, far(&on_parabola(&begin, &end, &s)), [begin, end])
    }

    /// Improve the nearest points where the moves are not straight.
    #[inline(always)]
    fn refined(&self, mut s: Lanes) -> Lanes {
        for _ in 0..REFINED {
            s = s.map(|s| s.clamp(STEP, 1.0 - STEP));
            let before = self.off_at(&s.map(|s| s - STEP));
            let x = self.off_at(&s);
            let after = self.off_at(&s.map(|s| s + STEP));
            let slope = both(&after, &before, |after, before| (after - before) / 2.0);
            let twice = both(&after, &x, |after, x| after - 2.0 * x);
            let curve = both(&twice, &before, |twice, before| twice + before);
            let (steep, bent) = (product(&slope, &slope), product(&x, &curve));
            let way = product(&x, &slope);
            for k in 0..SIDE {
                let curved = steep[k] + bent[k];
                s[k] = if curved > 0.0 { s[k] - STEP * way[k] / curved } else { s[k] };
            }
        }
        s.map(|s| s.clamp(0.0, 1.0))
    }
}

fn put<const K: usize>(columns: &mut [Lanes; K], lane: usize, row: &[f64; K]) {
    for (column, value) in columns.iter_mut().zip(row) {
        column[lane] = *value;
    }
}

fn side_by_side(rows: &[Three]) -> [Lanes; 3] {
    let mut columns = [[0.0; SIDE]; 3];
    for (lane, row) in rows.iter().enumerate() {
        put(&mut columns, lane, row);
    }
    columns
}

#[inline(always)]
fn both(a: &[Lanes; 3], b: &[Lanes; 3], make: impl Fn(f64, f64) -> f64) -> [Lanes; 3] {
    std::array::from_fn(|k| std::array::from_fn(|lane| make(a[k][lane], b[k][lane])))
}

#[inline(always)]
fn product(a: &[Lanes; 3], b: &[Lanes; 3]) -> Lanes {
    let mut sum = [0.0; SIDE];
    for lane in 0..SIDE {
        sum[lane] = a[0][lane] * b[0][lane] + a[1][lane] * b[1][lane] + a[2][lane] * b[2][lane];
    }
    sum
}

#[inline(always)]
fn far(x: &[Lanes; 3]) -> Lanes {
    product(x, x).map(f64::sqrt)
}

#[inline(always)]
fn on_parabola(b: &[Lanes; 3], e: &[Lanes; 3], s: &Lanes) -> [Lanes; 3] {
    let mut x = [[0.0; SIDE]; 3];
    for k in 0..3 {
        for lane in 0..SIDE {
            let s = s[lane];
            x[k][lane] = b[k][lane] * (1.0 - s) * (1.0 - s) + e[k][lane] * s * s;
        }
    }
    x
}

/// Say where a parabola leads at s.
#[inline(always)]
fn along_parabola(b: &[Lanes; 3], e: &[Lanes; 3], s: &Lanes) -> [Lanes; 3] {
    let mut way = [[0.0; SIDE]; 3];
    for k in 0..3 {
        for lane in 0..SIDE {
            way[k][lane] = e[k][lane] * s[lane] - b[k][lane] * (1.0 - s[lane]);
        }
    }
    let length = far(&way);
    way.map(|part| std::array::from_fn(|lane| part[lane] / length[lane].max(SHORT)))
}

/// Find the s at which begin (1 - s)^2 + end s^2 is shortest.
#[inline(always)]
fn nearest_on_parabola(b: &[Lanes; 3], e: &[Lanes; 3]) -> Lanes {
    let (mut s, mut least) = ([0.0; SIDE], [f64::INFINITY; SIDE]);
    for i in 0..=GRID {
        let at = i as f64 / GRID as f64;
        let away = far(&on_parabola(b, e, &[at; SIDE]));
        for lane in 0..SIDE {
            let nearer = away[lane] < least[lane];
            s[lane] = if nearer { at } else { s[lane] };
            least[lane] = if nearer { away[lane] } else { least[lane] };
        }
    }
    let bend = both(b, e, |b, e| 2.0 * (b + e));
    for _ in 0..ROUNDS {
        let x = on_parabola(b, e, &s);
        let mut slope = [[0.0; SIDE]; 3];
        for k in 0..3 {
            for lane in 0..SIDE {
                slope[k][lane] = 2.0 * (e[k][lane] * s[lane] - b[k][lane] * (1.0 - s[lane]));
            }
        }
        let (steep, bent) = (product(&slope, &slope), product(&x, &bend));
        let way = product(&x, &slope);
        for lane in 0..SIDE {
            let curved = steep[lane] + bent[lane];
            let next = (s[lane] - way[lane] / curved).clamp(0.0, 1.0);
            s[lane] = if curved > 0.0 { next } else { s[lane] };
        }
    }
    s
}

/// Find where the path passes corners.
#[inline(always)]
fn pass(mut group: Group<'_, '_>, within: &[f64]) -> Vec<Passed> {
    let (bend, nearest, off, along) = group.pass(within);
    let one = |(lane, corner): (usize, &Corner<'_>)| Passed {
        before: corner.before,
        behind: corner.behind,
        nearest: nearest[lane],
        q: corner.at(nearest[lane]),
        aside: off.map(|of| of[lane]),
        along: along.map(|of| of[lane]),
        bend: bend[lane],
    };
    group.corners.iter().enumerate().map(one).collect()
}

/// The same with registers for four numbers.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn pass_wide(group: Group<'_, '_>, within: &[f64]) -> Vec<Passed> {
    pass(group, within)
}

/// Choose what this machine can do; the numbers are the same.
fn pass_at_best(group: Group<'_, '_>, within: &[f64]) -> Vec<Passed> {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: this machine has what the function is compiled for.
        return unsafe { pass_wide(group, within) };
    }
    pass(group, within)
}

type Column<'py> = Bound<'py, PyArray1<f64>>;
type Block<'py> = Bound<'py, PyArray2<f64>>;

/// Find where the path passes c corners, `within` a distance [m] of their points.
///
/// Returns: before, behind, nearest (c,), q (c, 6), from the points to there and the direction
/// of the path there (c, 3), bend (c, 6).
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
) -> PyResult<(Column<'py>, Column<'py>, Column<'py>, Block<'py>, Block<'py>, Block<'py>, Block<'py>)>
{
    let (chain, paths) = (Chain::new(&parameters)?, Paths::of(&edges, &q)?);
    let (tool, point, within) = (rows::<3>(&tool)?, rows::<3>(&point)?, flat(&within)?);
    let corners = zones.corners(&paths)?;
    let n = same_length(&[corners.len(), tool.len(), point.len(), within.len()])?;
    let part = |some: Range<usize>| {
        let (mut found, mut own) = (Vec::with_capacity(some.len()), corners[some.clone()].to_vec());
        for (at, group) in own.chunks_mut(SIDE).enumerate() {
            let first = some.start + SIDE * at;
            let these = first..first + group.len();
            let group = Group::new(&chain, group, &tool[these.clone()], &point[these.clone()]);
            found.extend(pass_at_best(group, &within[these]));
        }
        found
    };
    let found = in_parts(py, n, WORTH, part)?;
    let column = |value: fn(&Passed) -> f64| -> Column<'py> {
        found.iter().map(value).collect::<Vec<_>>().into_pyarray(py)
    };
    Ok((
        column(|p| p.before),
        column(|p| p.behind),
        column(|p| p.nearest),
        array(py, found.iter().map(|p| p.q).collect()),
        array(py, found.iter().map(|p| p.aside).collect()),
        array(py, found.iter().map(|p| p.along).collect()),
        array(py, found.iter().map(|p| p.bend).collect()),
    ))
}

#[cfg(test)]
mod tests {
    use super::{far, nearest_on_parabola, on_parabola, Lanes, SIDE};

    #[test]
    fn the_nearest_point_is_as_near_as_a_fine_search_finds() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let mut any = || -> [Lanes; 3] { [0; 3].map(|_| [0; SIDE].map(|_| random())) };
        for _ in 0..200 / SIDE {
            let (b, e) = (any(), any());
            let away = |s: Lanes| far(&on_parabola(&b, &e, &s));
            let mut least = [f64::INFINITY; SIDE];
            for i in 0..=20_000 {
                let now = away([f64::from(i) / 20_000.0; SIDE]);
                least = std::array::from_fn(|k| least[k].min(now[k]));
            }
            let found = away(nearest_on_parabola(&b, &e));
            assert!((0..SIDE).all(|k| found[k] < least[k] + 1e-5 * least[k] + 1e-6));
        }
    }
}
