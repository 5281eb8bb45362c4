//! Which fly points are rounded, and how much of their moves that takes:
//! `postproc.motion.blending`.

use numpy::{Element, IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;

use crate::lines::{point, poses, Pose};
use crate::rows::{detached, dot, flat, minus, row, rows, same_length, Six};

const JOINT: i64 = 0; // `Motion`
const OVERLAP: i64 = 0; // `Fly`
const WITHIN: i64 = 2;
const EXACT: i64 = 3;
const HALF: f64 = 0.5; // of a move that a zone may take
const NOTHING: f64 = 1e-9; // [m], [rad] a move that goes nowhere has no corner

/// `Targets` of the package, as far as corners ask; one row of a column is that of all.
#[derive(FromPyObject)]
pub struct Targets<'py> {
    #[pyo3(attribute("move"))]
    motion: PyReadonlyArray1<'py, i64>,
    fly: PyReadonlyArray1<'py, bool>,
    via: PyReadonlyArray1<'py, bool>,
    rounding: PyReadonlyArray1<'py, i64>,
    fly_distance: PyReadonlyArray1<'py, f64>,
    overlap: PyReadonlyArray1<'py, f64>,
    linear_speed: PyReadonlyArray1<'py, f64>,
    tool: PyReadonlyArray3<'py, f64>,
    pred_start: PyReadonlyArray1<'py, i64>,
    pred: PyReadonlyArray1<'py, i64>,
}

/// A column of n rows, or one row for all.
struct Column<'a, T>(&'a [T]);

impl<'a, T: Copy + Element> Column<'a, T> {
    fn of(array: &'a PyReadonlyArray1<'_, T>, n: usize) -> PyResult<Self> {
        Column(flat(array)?).checked(n)
    }
}

impl<'a, T: Copy> Column<'a, T> {
    fn checked(self, n: usize) -> PyResult<Self> {
        if self.0.len() != n && self.0.len() != 1 {
            return Err(PyValueError::new_err("a column of other moves"));
        }
        Ok(self)
    }

    fn at(&self, i: usize) -> T {
        self.0[if self.0.len() == 1 { 0 } else { i }]
    }
}

/// A fly point between two moves, and the fractions of these that its zone takes.
struct Zone {
    visit: usize,
    into: usize,
    out: usize,
    shares: [f64; 2],
}

/// The moves of a program, and where they lead.
struct Program<'a> {
    motion: Column<'a, i64>,
    fly: Column<'a, bool>,
    via: Column<'a, bool>,
    rounding: Column<'a, i64>,
    distance: Column<'a, f64>,
    overlap: Column<'a, f64>,
    speed: Column<'a, f64>,
    tool: Column<'a, Pose>,
    first: &'a [i64],
    pred: &'a [i64],
    source: &'a [i64],
    q: &'a [Six],
    flange: &'a [Pose],
    /// Lengths of edges that are Cartesian paths [m].
    length: &'a [f64],
    /// Accelerations and speeds of the joints.
    push: Six,
    most: Six,
    /// Visit that each edge leads to.
    to: Vec<usize>,
}

impl Program<'_> {
    /// Tell whether all that is referred to is there.
    fn is_sound(&self) -> bool {
        let (n, e) = (self.q.len(), self.pred.len());
        self.first.len() == n + 1
            && self.first[0] == 0
            && self.first[n] == e as i64
            && self.first.windows(2).all(|two| two[0] <= two[1])
            && self.source.len() == e
            && self.length.len() == e
            && self.pred.iter().chain(self.source).all(|visit| *visit < n as i64)
    }

    /// Find the corners with one way in and one way out, and their largest zones.
    fn zones(&self) -> Vec<Zone> {
        let n = self.q.len();
        let (mut ways, mut out) = (vec![0_u32; n], vec![usize::MAX; n]);
        for (edge, pred) in self.pred.iter().enumerate() {
            if let Ok(visit) = usize::try_from(*pred) {
                ways[visit] += 1;
                out[visit] = edge;
            }
        }
        let corner = |visit: usize| {
            let (into, next) = (self.first[visit] as usize, out[visit]);
            let rounded = self.fly.at(visit)
                && !self.via.at(visit)
                && self.rounding.at(visit) < EXACT
                && self.first[visit + 1] - self.first[visit] == 1
                && ways[visit] == 1;
            if !(rounded && self.is_known(into) && self.is_known(next) && self.to[next] != visit) {
                return None;
            }
            let shares = self.shares(visit, [into, next]);
            let takes = shares.iter().all(|share| *share > 0.0);
            takes.then_some(Zone { visit, into, out: next, shares })
        };
        (0..n).filter_map(corner).collect()
    }

    /// Tell whether both ends of an edge are known.
    fn is_known(&self, edge: usize) -> bool {
        let known = |visit: usize| !self.q[visit][0].is_nan();
        let source = usize::try_from(self.source[edge]);
        source.is_ok_and(|source| known(source) && known(self.to[edge]))
    }

    /// Measure the TCP's way on an edge [m], the chord where it is no line.
    fn way(&self, edge: usize) -> f64 {
        let (to, tool) = (self.to[edge], self.tool.at(self.to[edge]));
        let begin = point(&self.flange[self.source[edge] as usize], &tool);
        let chord = minus(&point(&self.flange[to], &tool), &begin);
        self.length[edge].max(dot(&chord, &chord).sqrt()) // of which one may be unknown
    }

    /// Tell what parts of the moves before and behind a zone takes.
    fn shares(&self, visit: usize, edges: [usize; 2]) -> [f64; 2] {
        let ways = edges.map(|edge| self.way(edge));
        let next = self.motion.at(self.to[edges[1]]);
        let cartesian = self.motion.at(visit) != JOINT && next != JOINT;
        if cartesian && self.rounding.at(visit) != OVERLAP {
            return self.by_distance(visit, ways);
        }
        // Moves overlap while the first brakes and the second starts, at full override: a
        // path that changes with the override knob could not be proved.
        let ramps = [0, 1].map(|k| self.ramp(edges[k], ways[k]));
        let time = self.overlap.at(visit) * ramps[0].1.min(ramps[1].1);
        ramps.map(|(push, _)| push * (time * time) / 2.0)
    }

    /// Take the same length of both moves, all there is where only WITHIN bounds it.
    fn by_distance(&self, visit: usize, ways: [f64; 2]) -> [f64; 2] {
        let within = self.rounding.at(visit) == WITHIN;
        let begin = if within { f64::INFINITY } else { self.distance.at(visit) };
        let shortest = ways[0].min(ways[1]);
        if shortest.is_nan() || shortest <= NOTHING {
            return [0.0; 2];
        }
        ways.map(|way| begin.min(HALF * shortest) / way)
    }

    /// Give the acceleration of u [1/s^2] along a move, and how long it lasts [s].
    ///
    /// u goes from 0 to 1; the joints' limits are the bounds, and the programmed speed.
    fn ramp(&self, edge: usize, way: f64) -> (f64, f64) {
        let (begin, end) = (&self.q[self.source[edge] as usize], &self.q[self.to[edge]]);
        let turned: Six = std::array::from_fn(|j| (end[j] - begin[j]).abs());
        if !turned.iter().any(|turn| *turn > NOTHING) {
            return (0.0, 0.0);
        }
        let least = |limits: &Six| {
            let each = limits.iter().zip(&turned).map(|(limit, turn)| limit / turn.max(NOTHING));
            each.fold(f64::INFINITY, f64::min)
        };
        let (push, mut speed) = (least(&self.push), least(&self.most));
        if self.motion.at(self.to[edge]) != JOINT {
            speed = speed.min(self.speed.at(self.to[edge]) / way.max(NOTHING));
        }
        (push, (speed / push).min((1.0 / push).sqrt()))
    }
}

type Ints<'py> = Bound<'py, PyArray1<i64>>;
type Floats<'py> = Bound<'py, PyArray1<f64>>;

/// Find the corners with one way in and one way out, and their largest zones.
///
/// Args: the moves; where the edges come from (e,); joint angles (n, 6) [rad] and flange
/// poses (n, 4, 4) [m] at them; lengths of the edges that are Cartesian paths (e,) [m];
/// accelerations and speeds of the joints, (6,) each.
///
/// Returns: fly points, the edges before and behind each, and the fractions of these that
/// its zone takes, (c,) each.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn zones<'py>(
    py: Python<'py>,
    targets: Targets<'py>,
    source: PyReadonlyArray1<'py, i64>,
    q: PyReadonlyArray2<'py, f64>,
    flange: PyReadonlyArray3<'py, f64>,
    length: PyReadonlyArray1<'py, f64>,
    limits: (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>),
) -> PyResult<(Ints<'py>, Ints<'py>, Ints<'py>, Floats<'py>, Floats<'py>)> {
    let (q, flange) = (rows::<6>(&q)?, poses(&flange)?);
    let n = same_length(&[q.len(), flange.len()])?;
    let mut program = Program {
        motion: Column::of(&targets.motion, n)?,
        fly: Column::of(&targets.fly, n)?,
        via: Column::of(&targets.via, n)?,
        rounding: Column::of(&targets.rounding, n)?,
        distance: Column::of(&targets.fly_distance, n)?,
        overlap: Column::of(&targets.overlap, n)?,
        speed: Column::of(&targets.linear_speed, n)?,
        tool: Column(poses(&targets.tool)?).checked(n)?,
        first: flat(&targets.pred_start)?,
        pred: flat(&targets.pred)?,
        source: flat(&source)?,
        q,
        flange,
        length: flat(&length)?,
        push: row(&limits.0)?,
        most: row(&limits.1)?,
        to: Vec::new(),
    };
    if !program.is_sound() {
        return Err(PyIndexError::new_err("moves or edges that are not there"));
    }
    for (visit, edges) in program.first.windows(2).enumerate() {
        program.to.extend((edges[0]..edges[1]).map(|_| visit));
    }
    let found = detached(py, || program.zones())?;
    let ints = |of: fn(&Zone) -> usize| -> Ints<'py> {
        found.iter().map(|zone| of(zone) as i64).collect::<Vec<_>>().into_pyarray(py)
    };
    let share = |k: usize| -> Floats<'py> {
        found.iter().map(|zone| zone.shares[k]).collect::<Vec<_>>().into_pyarray(py)
    };
    Ok((ints(|z| z.visit), ints(|z| z.into), ints(|z| z.out), share(0), share(1)))
}
