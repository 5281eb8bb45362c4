//! The sides that targets are corrected for next: `postproc.compensation.aims`.
//!
//! A correction moves its target, and with it the place of every joint in its play there
//! and behind. So sides are settled in the order of the program: at each target from what
//! the ones before have become, to where aim and arrival are the same. A rounded corner
//! moves with the target behind it as well, so that this is done a few times.

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

const STEP: f64 = 0.5; // of a side, by which the answer of a command is found
const SETTLED: f64 = 1e-6; // sides that differ by less are the same
const AGREES: f64 = 1e-3; // .. and need no other correction
const GOES_ON: usize = 4; // looks along the answers, and as many from flanks
const NEWTON: usize = 6; // looks along their derivatives
const SWEEPS: i32 = 5; // the later ones know what becomes of the target behind
const LAST: i32 = 4; // sweeps that follow what has been settled
const FAR: usize = 6; // visits from what is reached from other sides, or bent by much
const LARGE: f64 = 5e-6; // [m] .. which is by more than this
const NEAR: f64 = 4.0; // halves of a play's width: a joint that moves farther may well leap
const LEAP: f64 = 0.5; // of a side, from visit to visit
const LEAPT: f64 = 0.1; // what a leap counts against what is off, both of a side
const TINY: f64 = 1e-7; // of a side, for derivatives
const SMALL: f64 = 1e-8; // [rad] and [m] that are not worth another look
const LITTLE: f64 = 1e-4; // [m] by which the answer of angles is found
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

/// What it takes to settle sides, and what has become of the visits so far.
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
    /// By what the path misses places, and is to be bent.
    missed: &'a [Three],
    /// How angles answer where places move, and of which joints targets and corners tell the
    /// ways to visits, of visits that were asked for.
    answers: Vec<OnceCell<Answer>>,
    told: Vec<OnceCell<[bool; 6]>>,
    /// What is known of the play at visits, as it was found and as it becomes.
    known: Vec<Clamp>,
    play: Vec<Clamp>,
    /// What the path moves by at the visits, and what their targets move by for that.
    bends: Bends<'a>,
    /// How commands answer, of visits that may be corrected for other sides [m].
    gains: Vec<Option<Gain>>,
    /// What they are corrected for next, and from where they are reached then.
    aims: Vec<Six>,
    reached: Vec<Six>,
    /// The sweep that has changed something of them last.
    changed: Vec<i32>,
    /// What they are corrected for stays now.
    holds: bool,
}

/// How the place of a command answers the sides that it is made for, a row for each side.
type Gain = [Three; 6];

/// What has become of a visit in a sweep: aim, reached, play, by what the path is passed
/// elsewhere there, by what its target and the one before move, and the last sweep that has
/// changed something.
pub const SETTLED_AS: usize = 34;

/// What the arrival at a visit depends on, but for where it is passed.
struct Look {
    visit: usize,
    /// The way there, None where nothing of it has moved, or several lead there.
    way: Option<Way>,
    /// Of which joints the way tells, and of which the plays told the sides.
    told: [bool; 6],
    known: [bool; 6],
    moved: Three,
}

impl Settling<'_> {
    /// Tell whether all that is referred to is there.
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

    /// Begin with bent corners; only what is near something that is off by much is free.
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

    /// Tell whether the path is to be bent at a visit, by more than something.
    fn is_bent(&self, i: usize, most: f64) -> bool {
        self.missed[i].iter().any(|by| by.abs() > most)
    }

    /// By what the path is to move for what it misses a visit by.
    fn bent(&self, i: usize) -> Three {
        self.missed[i].map(|part| -part)
    }

    /// The visit before one, where it alone leads there.
    fn before(&self, i: usize) -> Option<usize> {
        let edge = self.first[i] as usize;
        let alone = self.first[i + 1] as usize == edge + 1 && self.source[edge] + 1 == i as i64;
        if alone {
            i.checked_sub(1)
        } else {
            None
        }
    }

    /// Tell what has become of a visit.
    fn settled(&self, i: usize) -> [f64; SETTLED_AS] {
        let (bends, play) = (&self.bends, &self.play[i]);
        let before = bends.before[i].map_or(STAYS, |k| bends.moved[k]);
        let changed = [f64::from(self.changed[i])];
        let places = [&bends.shift[i], &bends.moved[i], &before];
        let sides = [&self.aims[i], &self.reached[i], &play.lo, &play.hi];
        let all = sides.iter().flat_map(|six| six.iter());
        let mut all = all.chain(places.iter().flat_map(|place| place.iter())).chain(&changed);
        std::array::from_fn(|_| *all.next().unwrap_or(&f64::NAN))
    }

    /// Let a visit become what it has become elsewhere in the same sweep.
    fn follow(&mut self, i: usize, settled: &[f64; SETTLED_AS]) {
        let six = |k: usize| std::array::from_fn(|j| settled[6 * k + j]);
        let place = |k: usize| std::array::from_fn(|j| settled[24 + 3 * k + j]);
        (self.aims[i], self.reached[i]) = (six(0), six(1));
        self.play[i] = Clamp { lo: six(2), hi: six(3) };
        self.bends.follow(i, place(0), place(1), place(2));
        self.changed[i] = settled[33] as i32;
    }

    /// Settle a visit anew, if what it depends on has changed since that was done.
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

    /// Settle a visit; return the sides to correct it for.
    ///
    /// Looked for is what agrees next to its sides; of joints that hardly move on a way
    /// without a stop, next to those of the visit before: there may be several that agree,
    /// and a path should not leap to and fro.
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

    /// Pass a visit elsewhere by something; return the sides that it is corrected for.
    fn pass(&mut self, i: usize, by: Three, arrived: (Six, Clamp), aim: Six) -> Six {
        (self.reached[i], self.play[i]) = arrived;
        self.bends.pass(i, by);
        aim
    }

    /// By what the path is to pass a visit elsewhere, corrected for some sides.
    fn shift(&self, i: usize, aim: &Six) -> Three {
        let bent = self.bent(i);
        let by = self.gains[i].map(|gain| moved(&gain, aim, &self.states.side[i]));
        by.map_or(bent, |by| sum(&bent, &by))
    }

    /// Gather what the arrival at a visit depends on; `stays`: and nothing of it has moved.
    fn look(&self, i: usize, stays: bool) -> Look {
        let answer = |k: usize| once(&self.answers, k, || self.answer(k));
        let way = if stays { None } else { Way::to(i, &self.bends, &answer, false) };
        let told = || {
            let (source, rest) = (self.bends.before[i]?, Way::to(i, &self.bends, &answer, true)?);
            Some(rest.tells(&self.angles[source], &self.clamps[self.first[i] as usize]))
        };
        let none = [false; 6];
        let told = way.as_ref().map_or(none, |_| once(&self.told, i, || told().unwrap_or(none)));
        let (known, at, half) = (&self.known[i], &self.angles[i], &self.half);
        let side = |j: usize| place_in_play(at[j], known.lo[j], known.hi[j], half[j]);
        let known = std::array::from_fn(|j| (side(j) - self.found[i][j]).abs() <= SETTLED);
        Look { visit: i, way, told, known, moved: self.bends.moved[i] }
    }

    /// The sides of the visit that alone leads to one, of joints that hardly move on a way
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

    /// The sides of a visit that is passed elsewhere by something, and what is known there
    /// of the play.
    ///
    /// What plays did not tell stays as it was found.
    fn arrived(&self, look: &Look, by: &Three) -> (Six, Clamp) {
        let (play, here) = self.led_to(look, by);
        let (found, half) = (&self.found[look.visit], &self.half);
        let side = |j: usize| place_in_play(here[j], play.lo[j], play.hi[j], half[j]);
        (std::array::from_fn(|j| if look.known[j] { side(j) } else { found[j] }), play)
    }

    /// What is known of the play at such a visit, and its angles.
    fn led_to(&self, look: &Look, by: &Three) -> (Clamp, Six) {
        let (i, half) = (look.visit, &self.half);
        let edges = self.first[i] as usize..self.first[i + 1] as usize;
        if let (Some(way), Some(source)) = (&look.way, self.bends.before[i]) {
            let (mut clamp, here) = way.at(by, &look.moved);
            if look.told.contains(&false) {
                let led = self.led(edges.start, source, i, by);
                for j in (0..6).filter(|j| !look.told[*j]) {
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

    /// What angles change by where a visit is passed elsewhere by something.
    fn answered(&self, i: usize, by: &Three) -> Six {
        if *by == STAYS {
            return [0.0; 6];
        }
        answered(&once(&self.answers, i, || self.answer(i)), by)
    }

    /// The same from both of its ends alone, where corners do not tell of it.
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

    /// Find how the place of a command answers the sides that it is made for.
    fn gain(&self, i: usize) -> Gain {
        let s = &self.states;
        let (q, side, tool) = (&s.q[i], &s.side[i], s.tool(i));
        let error = |side: &Six| {
            let told = (s.load(i), s.given(i));
            self.core.with_state((q, side), told.0, told.1, |state: &State<'_>| {
                self.core.error(state, tool)
            })
        };
        let here = error(side);
        std::array::from_fn(|j| {
            let step = if side[j] > 0.0 { -STEP } else { STEP };
            let mut other = *side;
            other[j] += step;
            let there = error(&other);
            std::array::from_fn(|k| (here[k] - there[k]) / step)
        })
    }

    /// How angles of a command change where its place does, if little.
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

/// What a command moves by where other sides are aimed for.
fn moved(gain: &Gain, next: &Six, aim: &Six) -> Three {
    std::array::from_fn(|m| (0..6).map(|j| gain[j][m] * (next[j] - aim[j])).sum())
}

fn largest(values: &Six) -> f64 {
    values.iter().fold(0.0, |most, value| if value.abs() > most { value.abs() } else { most })
}

/// Find sides that are their own answer, or nearly so.
///
/// First they follow their answers, then from the flanks that lie ahead; where they creep
/// or swing, Newton's method goes on from the best ones. A leap is taken where it
/// brings more than its weight.
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
            // It stays: go on with what comes behind.
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

/// Steps that lead to the flanks that lie ahead, where leaps have no weight.
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

/// The step of Newton's method; where there is none, half of the way. What agrees stays.
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

/// Find the sides that n targets are to be corrected for, and those that they are reached
/// from then, (n, 6), from the last look, and by what the path then passes them farther than
/// they move, (n, 3) [m].
///
/// Args: the model and the inverse kinematics; commands (n, 4, 4) [m] and tools, likewise
/// or (1, 4, 4); their states: joint angles of the commands, and the sides that they were
/// made for; the ways that led to the visits; (6, 6), from joints to drives; which may be
/// corrected for other sides, which are reached from others, and which the arm passes, (n,);
/// by what the path misses places and is to be bent, (n, 3) [m]; what became of the first k
/// in every sweep (s k, 34), where they were settled among others; and of which visits that
/// is returned.
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
        told: vec![OnceCell::new(); n],
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
    let (lead, watched) = (rows::<SETTLED_AS>(&lead)?, watched.0..watched.1);
    let mut seen = Vec::with_capacity(SWEEPS as usize * watched.len());
    let led = n.min(lead.len() / (SWEEPS + LAST) as usize);
    settling.prepare();
    for round in 0..SWEEPS + LAST {
        settling.holds = round >= SWEEPS;
        each(py, n, |i| {
            match lead.get(round as usize * led + i).filter(|_| i < led) {
                Some(settled) => settling.follow(i, settled),
                None => settling.sweep(i, round),
            }
            if watched.contains(&i) {
                seen.push(settling.settled(i));
            }
        })?;
    }
    let bends = &settling.bends;
    let farther = (0..n).map(|i| std::array::from_fn(|k| bends.shift[i][k] - bends.moved[i][k]));
    let farther: Vec<Three> = farther.collect();
    let aims = array(py, settling.aims);
    Ok((aims, array(py, settling.reached), array(py, farther), array(py, seen)))
}
