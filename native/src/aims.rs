//! The sides that targets are corrected for next: `postproc.compensation.aims`.
//!
//! A correction moves its target, and with it the place of every joint in its play there
//! and behind. So sides are settled in the order of the program: at each target from what
//! the ones before have become, to where aim and arrival are the same.

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::direction::place_in_play;
use crate::lines::{poses, Pose};
use crate::model::{Core, Rows, States};
use crate::numeric::solve;
use crate::play::{Clamp, Clamps};
use crate::pose::{inverted, product};
use crate::rows::{array, each, flat, row, rows, Six, Three};
use crate::solver::Solver;
use crate::terms::State;

const STEP: f64 = 0.5; // of a side, by which the answer of a command is found
const SETTLED: f64 = 1e-6; // sides that differ by less are the same
const AGREES: f64 = 1e-3; // .. and need no other correction
const GOES_ON: usize = 8; // looks along the answers, and as many from flanks
const NEWTON: usize = 6; // looks along their derivatives
const NEAR: f64 = 4.0; // halves of a play's width: a joint that moves farther may well leap
const LEAP: f64 = 0.5; // of a side, from visit to visit
const LEAPT: f64 = 0.1; // what a leap counts against what is off, both of a side
const TINY: f64 = 1e-7; // of a side, for derivatives

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
    free: &'a [bool],
    passes: &'a [bool],
    /// By what the path misses places, and is to be bent.
    missed: &'a [Three],
    /// What is known of the play at visits, as it becomes.
    play: Vec<Clamp>,
    /// What their angles change by.
    shift: Vec<Six>,
    /// What they are corrected for next.
    aims: Vec<Six>,
}

/// How angles answer the sides that a target is corrected for, a row for each side.
type Gain = [Six; 6];

impl Settling<'_> {
    /// Tell whether all that is referred to is there.
    fn is_sound(&self) -> bool {
        let (n, e) = (self.aims.len(), self.clamps.len());
        let columns = [self.commands.len(), self.angles.len(), self.found.len()];
        let others = [self.free.len(), self.passes.len(), self.missed.len(), self.play.len()];
        columns.iter().chain(&others).all(|length| *length == n)
            && (self.tools.len() == 1 || self.tools.len() == n)
            && self.first.len() == n + 1
            && self.first.windows(2).all(|pair| pair[0] <= pair[1])
            && self.first.iter().all(|edge| (0..=e as i64).contains(edge))
            && self.source.len() == e
            && self.source.iter().all(|visit| *visit < n as i64)
    }

    /// Settle a visit; return the sides to correct it for.
    ///
    /// Looked for is what agrees next to its sides; of joints that hardly move on a way
    /// without a stop, next to those of the visit before: there may be several that agree,
    /// and a path should not leap to and fro.
    fn settle(&mut self, i: usize) -> Six {
        let aim = self.states.side[i];
        let (rests, bent) = ([0.0; 6], self.bent(i));
        let still = self.arrived(i, &bent);
        let (old, now) = (self.sides(i, &rests, &self.play[i]), self.sides(i, &bent, &still));
        let differs = |a: &Six, b: &Six| (0..6).any(|j| (a[j] - b[j]).abs() > AGREES);
        // What plays do not tell stays as it was found.
        let told: [bool; 6] = std::array::from_fn(|j| (old[j] - self.found[i][j]).abs() <= SETTLED);
        let start: Six = std::array::from_fn(|j| if told[j] { now[j] } else { self.found[i][j] });
        if !self.free[i] || !differs(&start, &aim) {
            self.play[i] = still;
            self.shift[i] = bent;
            return aim;
        }
        let gain = self.gain(i);
        let answer = |next: &Six| -> Six {
            let by = sum(&bent, &moved(&gain, next, &aim));
            let sides = self.sides(i, &by, &self.arrived(i, &by));
            std::array::from_fn(|j| if told[j] { sides[j] } else { self.found[i][j] })
        };
        let near = self.near(i);
        let begin = std::array::from_fn(|j| near[j].unwrap_or(aim[j]));
        let weight = near.map(|side| if side.is_some() { LEAPT } else { 0.0 });
        let next = agreed(answer, &begin, &weight);
        let by = sum(&bent, &moved(&gain, &next, &aim));
        self.play[i] = self.arrived(i, &by);
        self.shift[i] = by;
        next
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

    fn sides(&self, i: usize, by: &Six, play: &Clamp) -> Six {
        let (angles, half) = (&self.angles[i], &self.half);
        std::array::from_fn(|j| place_in_play(angles[j] + by[j], play.lo[j], play.hi[j], half[j]))
    }

    /// What is known of the play at a visit whose angles change by something.
    fn arrived(&self, i: usize, by: &Six) -> Clamp {
        let here: Six = std::array::from_fn(|j| self.angles[i][j] + by[j]);
        let within = Clamp::passing(&here, &self.half);
        let edges = self.first[i] as usize..self.first[i + 1] as usize;
        if edges.is_empty() {
            return self.play[i];
        }
        let mut found: Option<Clamp> = None;
        for edge in edges {
            let Ok(source) = usize::try_from(self.source[edge]) else {
                return if i == 0 { self.play[i] } else { within };
            };
            let way = self.led(edge, source, i, by);
            let arrived = self.play[source].then(&way).then(&within);
            found = Some(found.map_or(arrived, |other| other.hull(&arrived)));
        }
        found.unwrap_or(within)
    }

    /// The clamp of a way whose both ends have moved.
    fn led(&self, edge: usize, source: usize, i: usize, by: &Six) -> Clamp {
        let (begin, end) = (&self.angles[source], &self.angles[i]);
        let from = &self.shift[source];
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

    /// Find how the angles of a command answer the sides that it is made for.
    fn gain(&self, i: usize) -> Gain {
        let s = &self.states;
        let (q, side, tool) = (&s.q[i], &s.side[i], s.tool(i));
        let error = |side: &Six| {
            let told = (s.load(i), s.given(i));
            self.core.with_state((q, side), told.0, told.1, |state: &State<'_>| {
                self.core.error(state, tool)
            })
        };
        let (here, answer) = (error(side), self.answer(i));
        std::array::from_fn(|j| {
            let step = if side[j] > 0.0 { -STEP } else { STEP };
            let mut other = *side;
            other[j] += step;
            let there = error(&other);
            answer(&std::array::from_fn(|k| (here[k] - there[k]) / step))
        })
    }

    /// How angles change where corners are bent by what they are missed by.
    fn bent(&self, i: usize) -> Six {
        let missed = &self.missed[i];
        if missed.iter().all(|part| *part == 0.0) {
            return [0.0; 6];
        }
        self.answer(i)(&missed.map(|part| -part))
    }

    /// How angles of a command change where its place does by something, if little.
    fn answer(&self, i: usize) -> impl Fn(&Three) -> Six + '_ {
        let q = &self.states.q[i];
        let mount = &self.tools[if self.tools.len() == 1 { 0 } else { i }];
        let (slot, from_tcp) = (self.solver.slot(q), inverted(mount));
        move |by| {
            let mut pose = self.commands[i];
            for k in 0..3 {
                pose[4 * k + 3] += by[k];
            }
            let new = self.solver.nearest(&product(&pose, &from_tcp), q, slot);
            let change: Six = std::array::from_fn(|m| new[m] - q[m]);
            std::array::from_fn(|m| {
                let answer = (0..6).map(|k| self.coupling[m][k] * change[k]).sum::<f64>();
                if answer.is_nan() {
                    0.0
                } else {
                    answer
                }
            })
        }
    }
}

fn sum(a: &Six, b: &Six) -> Six {
    std::array::from_fn(|j| a[j] + b[j])
}

/// What angles change by where another side is aimed for.
fn moved(gain: &Gain, next: &Six, aim: &Six) -> Six {
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

/// The step of Newton's method; where there is none, half of the way.
fn newton(off: &impl Fn(&Six) -> Six, at: &Six, step: &Six) -> Six {
    let columns = std::array::from_fn(|j| {
        let mut other = *at;
        let by = if at[j] > 0.0 { -TINY } else { TINY };
        other[j] += by;
        let there = off(&other);
        std::array::from_fn(|m| (step[m] - there[m]) / by)
    });
    solve(columns, *step).unwrap_or_else(|| step.map(|part| part / 2.0))
}

/// Find the sides that n targets are to be corrected for, (n, 6), from the last look.
///
/// Args: the model and the inverse kinematics; commands (n, 4, 4) [m] and tools, likewise
/// or (1, 4, 4); their states: joint angles of the commands, and the sides that they were
/// made for; the ways that led to the visits; (6, 6), from joints to drives; which may be
/// corrected for other sides, and which the arm passes, (n,); by what the path misses
/// places and is to be bent, (n, 3) [m].
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
    passes: PyReadonlyArray1<'py, bool>,
    missed: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let odd = |_| PyIndexError::new_err("six rows of six");
    let (states, play) = (states.rows(core)?, ways.play.list()?);
    let n = states.len();
    let mut settling = Settling {
        core,
        solver,
        commands: poses(&commands)?,
        tools: poses(&tool)?,
        aims: states.side.to_vec(),
        states,
        coupling: rows::<6>(&coupling)?.to_vec().try_into().map_err(odd)?,
        angles: rows::<6>(&ways.angles)?,
        first: flat(&ways.first)?,
        source: flat(&ways.source)?,
        clamps: ways.clamps.list()?,
        half: row(&ways.half)?,
        found: rows::<6>(&ways.side)?,
        free: flat(&free)?,
        passes: flat(&passes)?,
        missed: rows::<3>(&missed)?,
        play,
        shift: vec![[0.0; 6]; n],
    };
    if !settling.is_sound() {
        return Err(PyIndexError::new_err("visits or edges that are not there"));
    }
    each(py, n, |i| settling.aims[i] = settling.settle(i))?;
    Ok(array(py, settling.aims))
}
