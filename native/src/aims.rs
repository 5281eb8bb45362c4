//! The sides that targets are corrected for next: `postproc.compensation.solver.aims`.
//!
//! A correction moves its target, and with it the position of every joint in its play at
//! this target and at later ones. So the core solves for the sides in the order of the
//! program: at each target, with the corrections of the targets before, aim and arrival
//! must be the same. A blend depends on the target behind it as well, so the core sweeps
//! over the program several times.

use std::cell::OnceCell;

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::bends::{answered, once, sum, Answer, Bends, Way};
use crate::direction::place_in_play;
use crate::lines::{poses, Pose};
use crate::model::{Core, Rows, States};
use crate::numeric::solve;
use crate::play::{is_near, Clamp, Clamps};
use crate::pose::{inverted, product};
use crate::rows::{array, each, flat, row, rows, Six, Three};
use crate::solver::Solver;
use crate::terms::State;

const STEP: f64 = 0.5; // of a side: step of the derivatives of a command
const SETTLED: f64 = 1e-6; // sides that differ by less are the same
const AGREES: f64 = 1e-3; // .. and need no other correction
const GOES_ON: usize = 4; // fixed-point iterations, and as many from flanks
const NEWTON: usize = 6; // iterations of Newton's method
const SWEEPS: i32 = 5; // the later ones know the target behind
const LAST: i32 = 4; // sweeps with constant aims
const FAR: usize = 6; // visits from one with another arrival, or a large miss
const LARGE: f64 = 5e-6; // [m] a large miss
const NEAR: f64 = 4.0; // halves of a play's width: a joint that moves farther may change its side
const LEAP: f64 = 0.5; // of a side, from visit to visit
const LEAPT: f64 = 0.1; // weight of a leap against a disagreement, both of a side
const TINY: f64 = 1e-7; // of a side, for derivatives
const SMALL: f64 = 1e-8; // [rad] and [m] that need no further sweep
const LITTLE: f64 = 1e-4; // [m] step of the derivatives of angles
const STAYS: Three = [0.0; 3];

type Block<'py> = Bound<'py, PyArray2<f64>>;

/// `Ways` of the package.
#[derive(FromPyObject)]
pub struct Ways<'py> {
    angles: PyReadonlyArray2<'py, f64>,
    first: PyReadonlyArray1<'py, i64>,
    source: PyReadonlyArray1<'py, i64>,
    clamps: Clamps<'py>,
    play: Clamps<'py>,
    half: PyReadonlyArray1<'py, f64>,
    side: PyReadonlyArray2<'py, f64>,
    targets: PyReadonlyArray2<'py, f64>,
    places: PyReadonlyArray2<'py, f64>,
    rounded: PyReadonlyArray2<'py, f64>,
    corrected: PyReadonlyArray1<'py, bool>,
}

/// The inputs of the sides, and the state of the visits after the last sweep.
struct Settling<'a> {
    core: &'a Core,
    solver: &'a Solver,
    commands: &'a [Pose],
    tools: &'a [Pose],
    states: Rows<'a>,
    /// From joints to drives.
    coupling: [Six; 6],
    angles: &'a [Six],
    first: &'a [i64],
    source: &'a [i64],
    clamps: Vec<Clamp>,
    half: Six,
    found: &'a [Six],
    /// Visits that may be corrected for other sides, and those that are reached from others.
    free: Vec<bool>,
    off: &'a [bool],
    passes: &'a [bool],
    /// Distance by which the path misses places, which the targets must make up for.
    missed: &'a [Three],
    /// Derivatives of the angles by places, and the joints whose paths to the visit follow
    /// from targets and blends alone. Only of visits that were needed.
    answers: Vec<OnceCell<Answer>>,
    blended: Vec<OnceCell<[bool; 6]>>,
    /// State of the play operator at visits, as it was found and as it will be.
    known: Vec<Clamp>,
    play: Vec<Clamp>,
    /// Displacements of the path at the visits, and of their targets.
    bends: Bends<'a>,
    /// Derivatives of commands by sides, of visits that may get other sides [m].
    gains: Vec<Option<Gain>>,
    /// The sides that visits are corrected for next, and those of their arrivals then.
    aims: Vec<Six>,
    reached: Vec<Six>,
    /// The last sweep that changed something of them.
    changed: Vec<i32>,
    /// The aims are constant from now on.
    holds: bool,
}

/// Derivatives of the place of a command by the sides of its aim, a row for each side.
type Gain = [Three; 6];

/// Length of the state of a visit after a sweep: aim, arrival, play, displacements of the
/// path there, of its target and of the target before, and the last sweep with a change.
pub const STATE: usize = 34;

/// The inputs of the arrival at a visit, except for where the path passes it.
struct Look {
    visit: usize,
    /// The path to the visit; None if nothing of it has moved, or if there are several.
    way: Option<Way>,
    /// The joints whose path `way` describes, and those whose side follows from the play.
    blended: [bool; 6],
    known: [bool; 6],
    moved: Three,
}

impl Settling<'_> {
    /// Return True if all columns have their length, and all references exist.
    fn is_sound(&self) -> bool {
        let (n, e) = (self.aims.len(), self.clamps.len());
        let columns = [self.commands.len(), self.angles.len(), self.found.len()];
        let others = [
            self.free.len(),
            self.off.len(),
            self.passes.len(),
            self.missed.len(),
            self.known.len(),
        ];
        let bends = &self.bends;
        let targets = [bends.targets.len(), bends.places.len()];
        let corners = [bends.rounded.len(), bends.corrected.len()];
        columns.iter().chain(&others).chain(&targets).chain(&corners).all(|length| *length == n)
            && (self.tools.len() == 1 || self.tools.len() == n)
            && self.first.len() == n + 1
            && self.first.windows(2).all(|pair| pair[0] <= pair[1])
            && self.first.iter().all(|edge| (0..=e as i64).contains(edge))
            && self.source.len() == e
            && self.source.iter().all(|visit| *visit < n as i64)
    }

    /// Make up for misses of the path; only visits near another arrival or a miss are free.
    fn prepare(&mut self) {
        let n = self.aims.len();
        self.bends.before = (0..n).map(|i| self.before(i)).collect();
        self.bends.begin();
        let far: Vec<bool> = (0..n).map(|i| self.off[i] || self.is_bent(i, LARGE)).collect();
        let near = |i: usize| far[i.saturating_sub(FAR)..n.min(i + FAR)].contains(&true);
        self.free = (0..n).map(|i| self.free[i] && near(i)).collect();
        for i in 0..n {
            if self.off[i] || self.is_bent(i, 0.0) {
                self.bends.pass(i, self.bent(i));
                self.changed[i] = -1;
            }
        }
    }

    /// Return True if the path misses a visit by more than a distance.
    fn is_bent(&self, i: usize, most: f64) -> bool {
        self.missed[i].iter().any(|by| by.abs() > most)
    }

    /// Return the displacement of the path that makes up for its miss of a visit.
    fn bent(&self, i: usize) -> Three {
        self.missed[i].map(|part| -part)
    }

    /// Return the visit before one, if the path comes from there alone.
    fn before(&self, i: usize) -> Option<usize> {
        let edge = self.first[i] as usize;
        let alone = self.first[i + 1] as usize == edge + 1 && self.source[edge] + 1 == i as i64;
        if alone {
            i.checked_sub(1)
        } else {
            None
        }
    }

    /// Return the state of a visit.
    fn state(&self, i: usize) -> [f64; STATE] {
        let (bends, play) = (&self.bends, &self.play[i]);
        let before = bends.before[i].map_or(STAYS, |k| bends.moved[k]);
        let changed = [f64::from(self.changed[i])];
        let places = [&bends.shift[i], &bends.moved[i], &before];
        let sides = [&self.aims[i], &self.reached[i], &play.lo, &play.hi];
        let all = sides.iter().flat_map(|six| six.iter());
        let mut all = all.chain(places.iter().flat_map(|place| place.iter())).chain(&changed);
        std::array::from_fn(|_| *all.next().unwrap_or(&f64::NAN))
    }

    /// Take the state of a visit from the same sweep over the window before.
    fn follow(&mut self, i: usize, state: &[f64; STATE]) {
        let six = |k: usize| std::array::from_fn(|j| state[6 * k + j]);
        let place = |k: usize| std::array::from_fn(|j| state[24 + 3 * k + j]);
        (self.aims[i], self.reached[i]) = (six(0), six(1));
        self.play[i] = Clamp { lo: six(2), hi: six(3) };
        self.bends.follow(i, place(0), place(1), place(2));
        self.changed[i] = state[33] as i32;
    }

    /// Solve for the sides of a visit again, if its inputs have changed since.
    fn sweep(&mut self, i: usize, round: i32) {
        let near = i.saturating_sub(2)..(i + 3).min(self.changed.len());
        if self.changed[near].iter().all(|at| *at < round - 1) {
            return;
        }
        let (play, moved) = (self.play[i], self.bends.moved[i]);
        self.aims[i] = self.settle(i);
        if !play.is_near(&self.play[i], SMALL) || !is_near(&moved, &self.bends.moved[i], SMALL) {
            self.changed[i] = round;
        }
    }

    /// Solve for the sides of a visit; return those to correct it for.
    ///
    /// Several sides may agree with their arrivals. The solution is the one next to the
    /// sides of the visit. For a joint that hardly moves on a path without a stop, it is the
    /// one next to the sides of the visit before, so that the path does not leap to and fro.
    fn settle(&mut self, i: usize) -> Six {
        let (aim, last) = (self.states.side[i], self.aims[i]);
        let differs = |a: &Six, b: &Six| (0..6).any(|j| (a[j] - b[j]).abs() > AGREES);
        let by = self.shift(i, &last);
        let stays = by == STAYS && self.bends.is_quiet(i);
        let look = self.look(i, stays);
        let now = self.arrived(&look, &by);
        if self.holds || !self.free[i] || !differs(&now.0, &last) {
            return self.pass(i, by, now, last);
        }
        if self.gains[i].is_none() {
            self.gains[i] = Some(self.gain(i));
        }
        let look = if stays { self.look(i, false) } else { look };
        let near = self.near(i);
        let begin = std::array::from_fn(|j| near[j].unwrap_or(aim[j]));
        let weight = near.map(|side| if side.is_some() { LEAPT } else { 0.0 });
        let next = agreed(|next| self.arrived(&look, &self.shift(i, next)).0, &begin, &weight);
        let by = self.shift(i, &next);
        self.pass(i, by, self.arrived(&look, &by), next)
    }

    /// Displace the path at a visit; return the sides that the visit is corrected for.
    fn pass(&mut self, i: usize, by: Three, arrived: (Six, Clamp), aim: Six) -> Six {
        (self.reached[i], self.play[i]) = arrived;
        self.bends.pass(i, by);
        aim
    }

    /// Return the displacement of the path at a visit that is corrected for some sides.
    fn shift(&self, i: usize, aim: &Six) -> Three {
        let bent = self.bent(i);
        let by = self.gains[i].map(|gain| moved(&gain, aim, &self.states.side[i]));
        by.map_or(bent, |by| sum(&bent, &by))
    }

    /// Gather the inputs of the arrival at a visit; `stays`: nothing of them has moved.
    fn look(&self, i: usize, stays: bool) -> Look {
        let answer = |k: usize| once(&self.answers, k, || self.answer(k));
        let way = if stays { None } else { Way::to(i, &self.bends, &answer, false) };
        let blended = || {
            let (source, rest) = (self.bends.before[i]?, Way::to(i, &self.bends, &answer, true)?);
            Some(rest.describes(&self.angles[source], &self.clamps[self.first[i] as usize]))
        };
        let none = [false; 6];
        let found = || once(&self.blended, i, || blended().unwrap_or(none));
        let blended = way.as_ref().map_or(none, |_| found());
        let (known, at, half) = (&self.known[i], &self.angles[i], &self.half);
        let side = |j: usize| place_in_play(at[j], known.lo[j], known.hi[j], half[j]);
        let known = std::array::from_fn(|j| (side(j) - self.found[i][j]).abs() <= SETTLED);
        Look { visit: i, way, blended, known, moved: self.bends.moved[i] }
    }

    /// Return the sides of the only visit before one, for joints that hardly move on a path
    /// without a stop.
    fn near(&self, i: usize) -> [Option<f64>; 6] {
        let edge = self.first[i] as usize;
        let alone = self.first[i + 1] as usize == edge + 1;
        let Some(source) = alone.then(|| usize::try_from(self.source[edge]).ok()).flatten() else {
            return [None; 6];
        };
        let goes_on = source < i && (self.passes[source] || self.passes[i]);
        std::array::from_fn(|j| {
            let way = (self.angles[i][j] - self.angles[source][j]).abs();
            (goes_on && way < NEAR * self.half[j]).then(|| self.aims[source][j])
        })
    }

    /// Return the sides at a visit with a displacement of the path, and the play's state.
    ///
    /// Sides that do not follow from the play stay as they were found.
    fn arrived(&self, look: &Look, by: &Three) -> (Six, Clamp) {
        let (play, here) = self.led_to(look, by);
        let (found, half) = (&self.found[look.visit], &self.half);
        let side = |j: usize| place_in_play(here[j], play.lo[j], play.hi[j], half[j]);
        (std::array::from_fn(|j| if look.known[j] { side(j) } else { found[j] }), play)
    }

    /// Return the state of the play at such a visit, and its angles.
    fn led_to(&self, look: &Look, by: &Three) -> (Clamp, Six) {
        let (i, half) = (look.visit, &self.half);
        let edges = self.first[i] as usize..self.first[i + 1] as usize;
        if let (Some(way), Some(source)) = (&look.way, self.bends.before[i]) {
            let (mut clamp, here) = way.at(by, &look.moved);
            if look.blended.contains(&false) {
                let led = self.led(edges.start, source, i, by);
                for j in (0..6).filter(|j| !look.blended[*j]) {
                    (clamp.lo[j], clamp.hi[j]) = (led.lo[j], led.hi[j]);
                }
            }
            return (self.play[source].then(&clamp).then(&Clamp::passing(&here, half)), here);
        }
        let here = sum(&self.angles[i], &self.answered(i, by));
        if edges.is_empty() {
            return (self.known[i], here);
        }
        let within = Clamp::passing(&here, half);
        let mut found: Option<Clamp> = None;
        for edge in edges {
            let Ok(source) = usize::try_from(self.source[edge]) else {
                return (if i == 0 { self.known[i] } else { within }, here);
            };
            let way = self.led(edge, source, i, by);
            let arrived = self.play[source].then(&way).then(&within);
            found = Some(found.map_or(arrived, |other| other.hull(&arrived)));
        }
        (found.unwrap_or(within), here)
    }

    /// Return the change of the angles at a visit with a displacement of the path.
    fn answered(&self, i: usize, by: &Three) -> Six {
        if *by == STAYS {
            return [0.0; 6];
        }
        answered(&once(&self.answers, i, || self.answer(i)), by)
    }

    /// Return the play operator of a path from its ends alone.
    fn led(&self, edge: usize, source: usize, i: usize, by: &Three) -> Clamp {
        let (begin, end) = (&self.angles[source], &self.angles[i]);
        let from = self.answered(source, &self.bends.shift[source]);
        let by = self.answered(i, by);
        let (way, half) = (&self.clamps[edge], &self.half);
        let along = |x: f64, j: usize| {
            let part = (x - begin[j]) / (end[j] - begin[j]);
            let part = if part.is_nan() { 1.0 } else { part.clamp(0.0, 1.0) };
            from[j] + part * (by[j] - from[j])
        };
        let mut out = *way;
        for j in 0..6 {
            let (top, bottom) = (way.lo[j] + half[j], way.hi[j] - half[j]);
            if way.hi[j] > way.lo[j] {
                out.lo[j] += along(top, j);
                out.hi[j] += along(bottom, j);
            } else {
                // What was before is forgotten: by a place it went down to, or up to.
                let last =
                    if (top - end[j]).abs() < (bottom - end[j]).abs() { top } else { bottom };
                let by = along(last, j);
                out.lo[j] += by;
                out.hi[j] += by;
            }
        }
        out
    }

    /// Compute the derivatives of the place of a command by the sides of its aim.
    fn gain(&self, i: usize) -> Gain {
        let s = &self.states;
        let (q, side, tool) = (&s.q[i], &s.side[i], s.tool(i));
        self.core.with_state((q, side), s.load(i), s.given(i), |state: &State<'_>| {
            let error = |side: &Six| self.core.error(&State { side, ..*state }, tool);
            let here = error(side);
            std::array::from_fn(|j| {
                let step = if side[j] > 0.0 { -STEP } else { STEP };
                let mut other = *side;
                other[j] += step;
                let there = error(&other);
                std::array::from_fn(|k| (here[k] - there[k]) / step)
            })
        })
    }

    /// Compute the derivatives of the angles of a command by its place.
    fn answer(&self, i: usize) -> Answer {
        let q = &self.states.q[i];
        let mount = &self.tools[if self.tools.len() == 1 { 0 } else { i }];
        let (slot, from_tcp) = (self.solver.slot(q), inverted(mount));
        std::array::from_fn(|k| {
            let mut pose = self.commands[i];
            pose[4 * k + 3] += LITTLE;
            let new = self.solver.nearest(&product(&pose, &from_tcp), q, slot);
            let change: Six = std::array::from_fn(|m| (new[m] - q[m]) / LITTLE);
            std::array::from_fn(|m| {
                let answer = (0..6).map(|k| self.coupling[m][k] * change[k]).sum::<f64>();
                if answer.is_nan() {
                    0.0
                } else {
                    answer
                }
            })
        })
    }
}

/// Return the displacement of a command for other sides.
fn moved(gain: &Gain, next: &Six, aim: &Six) -> Three {
    std::array::from_fn(|m| (0..6).map(|j| gain[j][m] * (next[j] - aim[j])).sum())
}

fn largest(values: &Six) -> f64 {
    values.iter().fold(0.0, |most, value| if value.abs() > most { value.abs() } else { most })
}

/// Find sides that are the same as their arrival, or nearly so.
///
/// A fixed-point iteration begins at the sides, then at the flanks that lie ahead. If it
/// converges slowly or swings, Newton's method begins at the best sides. A leap must improve
/// the agreement by more than its weight.
fn agreed(answer: impl Fn(&Six) -> Six, begin: &Six, weight: &Six) -> Six {
    let off = |next: &Six| -> Six {
        let found = answer(next);
        std::array::from_fn(|j| found[j] - next[j])
    };
    let (mut next, mut best, mut least) = (*begin, *begin, f64::INFINITY);
    let mut look = 0;
    while look < 2 * GOES_ON + NEWTON && least > SETTLED {
        let step = off(&next);
        let leap = |j: usize| (next[j] - begin[j]).abs();
        let leaps = (0..6).filter(|j| leap(*j) > LEAP).map(|j| weight[j] * leap(j));
        let cost = largest(&step) + leaps.fold(0.0, f64::max);
        if cost < least {
            (best, least) = (next, cost);
        }
        look += 1;
        let step = match look {
            GOES_ON => to_flanks(&step, weight),
            look if look < 2 * GOES_ON => step,
            _ => newton(&off, &next, &step),
        };
        let last = next;
        next = std::array::from_fn(|j| (next[j] + step[j]).clamp(-1.0, 1.0));
        if (0..6).all(|j| (next[j] - last[j]).abs() <= SETTLED) {
            // It has converged: begin the next method.
            look = match look {
                look if look < GOES_ON => GOES_ON - 1,
                look if look < 2 * GOES_ON => 2 * GOES_ON,
                _ => break,
            };
        }
        if look == 2 * GOES_ON {
            next = best;
        }
    }
    best
}

/// Return steps to the flanks that lie ahead, for joints whose leaps have no weight.
fn to_flanks(step: &Six, weight: &Six) -> Six {
    std::array::from_fn(|j| {
        let far = step[j].abs() > AGREES && weight[j] == 0.0;
        if far {
            2.0 * step[j].signum()
        } else {
            step[j]
        }
    })
}

/// Return the step of Newton's method, or half of the disagreement if there is none.
fn newton(off: &impl Fn(&Six) -> Six, at: &Six, step: &Six) -> Six {
    let columns = std::array::from_fn(|j| {
        if step[j].abs() <= SETTLED {
            return std::array::from_fn(|m| f64::from(u8::from(m == j)));
        }
        let mut other = *at;
        let by = if at[j] > 0.0 { -TINY } else { TINY };
        other[j] += by;
        let there = off(&other);
        std::array::from_fn(|m| (step[m] - there[m]) / by)
    });
    solve(columns, *step).unwrap_or_else(|| step.map(|part| part / 2.0))
}

/// Find the sides that n targets are to be corrected for, and the sides of their arrivals
/// then, (n, 6), the displacements of the path without those of the targets, (n, 3) [m], and
/// the states of the watched visits after each of s sweeps, (s w, 34).
///
/// Args: the model and the inverse kinematics; commands (n, 4, 4) [m] and tools, likewise
/// or (1, 4, 4); their states: joint angles of the commands, and the sides of their aims; the
/// paths to the visits; (6, 6), from joints to drives; which visits may get other sides,
/// which arrivals are others, and which visits the arm passes, (n,); the distances by which
/// the path misses places, (n, 3) [m]; the states of the first k visits after each sweep over
/// the window before, (s k, 34); and the first and last visit that is watched.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // what a look has found
pub fn next_aims<'py>(
    py: Python<'py>,
    core: &Core,
    solver: &Solver,
    commands: PyReadonlyArray3<'py, f64>,
    tool: PyReadonlyArray3<'py, f64>,
    states: States<'py>,
    ways: Ways<'py>,
    coupling: PyReadonlyArray2<'py, f64>,
    free: PyReadonlyArray1<'py, bool>,
    off: PyReadonlyArray1<'py, bool>,
    passes: PyReadonlyArray1<'py, bool>,
    missed: PyReadonlyArray2<'py, f64>,
    lead: PyReadonlyArray2<'py, f64>,
    watched: (usize, usize),
) -> PyResult<(Block<'py>, Block<'py>, Block<'py>, Block<'py>)> {
    let odd = |_| PyIndexError::new_err("six rows of six");
    let (states, known) = (states.rows(core)?, ways.play.list()?);
    let (n, half, angles) = (states.len(), row(&ways.half)?, rows::<6>(&ways.angles)?);
    let bends = Bends {
        targets: rows::<6>(&ways.targets)?,
        passed: angles,
        places: rows::<3>(&ways.places)?,
        rounded: rows::<7>(&ways.rounded)?,
        corrected: flat(&ways.corrected)?,
        before: Vec::new(),
        half,
        shift: vec![STAYS; n],
        moved: vec![STAYS; n],
        corners: Vec::new(),
    };
    let mut settling = Settling {
        core,
        solver,
        commands: poses(&commands)?,
        tools: poses(&tool)?,
        aims: states.side.to_vec(),
        states,
        coupling: rows::<6>(&coupling)?.to_vec().try_into().map_err(odd)?,
        angles,
        first: flat(&ways.first)?,
        source: flat(&ways.source)?,
        clamps: ways.clamps.list()?,
        half,
        found: rows::<6>(&ways.side)?,
        free: flat(&free)?.to_vec(),
        off: flat(&off)?,
        passes: flat(&passes)?,
        missed: rows::<3>(&missed)?,
        answers: vec![OnceCell::new(); n],
        blended: vec![OnceCell::new(); n],
        play: known.clone(),
        known,
        bends,
        gains: vec![None; n],
        reached: rows::<6>(&ways.side)?.to_vec(),
        changed: vec![-2; n],
        holds: false,
    };
    if !settling.is_sound() {
        return Err(PyIndexError::new_err("visits or edges that are not there"));
    }
    let (lead, watched) = (rows::<STATE>(&lead)?, watched.0..watched.1);
    let mut seen = Vec::with_capacity(SWEEPS as usize * watched.len());
    let led = n.min(lead.len() / (SWEEPS + LAST) as usize);
    settling.prepare();
    for round in 0..SWEEPS + LAST {
        settling.holds = round >= SWEEPS;
        each(py, n, |i| {
            match lead.get(round as usize * led + i).filter(|_| i < led) {
                Some(state) => settling.follow(i, state),
                None => settling.sweep(i, round),
            }
            if watched.contains(&i) {
                seen.push(settling.state(i));
            }
        })?;
    }
    let bends = &settling.bends;
    let farther = (0..n).map(|i| std::array::from_fn(|k| bends.shift[i][k] - bends.moved[i][k]));
    let farther: Vec<Three> = farther.collect();
    let aims = array(py, settling.aims);
    Ok((aims, array(py, settling.reached), array(py, farther), array(py, seen)))
}
