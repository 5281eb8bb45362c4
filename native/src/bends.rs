//! Paths of joints between fly points after these have moved, as the play operator needs them.

use std::cell::OnceCell;

use crate::corner::is_flat;
use crate::play::Clamp;
use crate::pull::across;
use crate::rows::{Six, Three};

const SAME: f64 = 1e-6; // [rad] a path that follows from its targets
const EVEN: f64 = 1e-6; // of its size: a zone that is as large before as behind
const NOTHING: f64 = 1e-9; // [m] by which nothing moves
const STAYS: Three = [0.0; 3];

/// Which parts of the moves before and behind a target its corner takes, and where on it
/// the path passes the target.
#[derive(Clone, Copy)]
struct Corner {
    before: f64,
    behind: f64,
    nearest: f64,
    along: Three,
}

impl Corner {
    /// The shares of the targets before and behind in a place on the corner.
    fn shares(&self, s: f64) -> (f64, f64) {
        (self.before * (1.0 - s) * (1.0 - s), self.behind * s * s)
    }

    /// Round two moves, from and to a target, instead of those that it rounds.
    ///
    /// A zone that reaches as far before as behind goes on doing so: as far as before, or to
    /// the middle of the shorter move.
    fn round(&self, old: &[Three; 2], new: &[Three; 2]) -> Corner {
        let reach = [self.before * length(&old[0]), self.behind * length(&old[1])];
        let (mut before, mut behind) = (self.before, self.behind);
        if (reach[0] - reach[1]).abs() <= EVEN * reach[0] {
            let halved = before.max(behind) > 0.5 - EVEN;
            let most = if halved { f64::INFINITY } else { reach[0] };
            let size = [length(&new[0]), length(&new[1])];
            let zone = most.min(size[0] / 2.0).min(size[1] / 2.0);
            (before, behind) = (zone / size[0], zone / size[1]);
        }
        let (now, then) =
            (self.leads(before, behind, new), self.leads(self.before, self.behind, old));
        let along = unit(&sum(&self.along, &less(&now, &then)));
        Corner { before, behind, nearest: self.nearest, along }
    }

    /// Say where straight moves lead whose corner takes such parts of them.
    fn leads(&self, before: f64, behind: f64, moves: &[Three; 2]) -> Three {
        let (v, w) = (before * (1.0 - self.nearest), behind * self.nearest);
        unit(&std::array::from_fn(|k| w * moves[1][k] - v * moves[0][k]))
    }

    /// Say how far the path passes beside the target.
    fn aside(&self, moves: &[Three; 2]) -> Three {
        let (v, w) = self.shares(self.nearest);
        let aside: Three = std::array::from_fn(|k| v * moves[0][k] + w * moves[1][k]);
        across(&aside, &self.along)
    }

    /// Follow it between three targets, as `corner::Corner` does between straight moves.
    fn at(&self, [before, here, behind]: [&Six; 3], s: f64) -> Six {
        let (v, w) = self.shares(s);
        std::array::from_fn(|j| here[j] + v * (before[j] - here[j]) + w * (behind[j] - here[j]))
    }

    /// Say where every joint turns between two places, or the first of these.
    fn farthest(&self, [before, here, behind]: [&Six; 3], begin: f64, end: f64) -> Six {
        std::array::from_fn(|j| {
            let first = self.before * (before[j] - here[j]);
            let last = self.behind * (behind[j] - here[j]);
            let turn = first / (first + last);
            let s = if turn > begin && turn < end { turn } else { begin };
            here[j] + first * (1.0 - s) * (1.0 - s) + last * s * s
        })
    }

    fn is_flat(&self, [before, here, behind]: [&Six; 3]) -> bool {
        let (a, b) = (self.before, self.behind);
        is_flat(&std::array::from_fn(|j| a * (before[j] - here[j]) + b * (behind[j] - here[j])))
    }
}

/// How angles answer where a place moves along the axes of the base.
pub type Answer = [Six; 3];

/// Return the change of angles for a displacement of the place.
pub fn answered(answer: &Answer, by: &Three) -> Six {
    std::array::from_fn(|j| answer[0][j] * by[0] + answer[1][j] * by[1] + answer[2][j] * by[2])
}

/// What a target must move by for the path to move by something where it passes: all of it,
/// a part of it across the path once more, and something besides.
#[derive(Clone, Copy)]
struct Need {
    all: f64,
    part: f64,
    besides: Three,
    along: Three,
}

/// What a target needs that no corner rounds.
const STILL: Need = Need { all: 1.0, part: 0.0, besides: STAYS, along: STAYS };

impl Need {
    fn of(&self, by: &Three) -> Three {
        let more = across(by, &self.along);
        std::array::from_fn(|k| self.all * by[k] + self.part * more[k] + self.besides[k])
    }
}

/// Targets one after the other, whose corners are rounded, and how they move.
pub struct Bends<'a> {
    /// Angles at the targets, and where the path passes them [rad].
    pub targets: &'a [Six],
    pub passed: &'a [Six],
    /// Where the targets are [m].
    pub places: &'a [Three],
    /// Their corners, as `BlendCoupling.of` has them.
    pub rounded: &'a [[f64; 7]],
    /// The targets that may move.
    pub corrected: &'a [bool],
    /// The visit before, where it alone leads there.
    pub before: Vec<Option<usize>>,
    pub half: Six,
    /// Displacements of the path where it passes the targets, and of the targets [m].
    pub shift: Vec<Three>,
    pub moved: Vec<Three>,
    /// Parts of the moves before and behind, and the path's direction, of rounded targets
    /// as they become.
    pub corners: Vec<Option<Rounding>>,
}

/// A corner as it was found and as it will be, and how far the path passed its target.
#[derive(Clone, Copy)]
pub struct Rounding {
    found: Corner,
    now: Corner,
    aside: Three,
}

impl Bends<'_> {
    /// Take the corners as they were found.
    pub fn begin(&mut self) {
        self.corners = (0..self.rounded.len()).map(|i| self.found(i)).collect();
    }

    fn found(&self, i: usize) -> Option<Rounding> {
        let [before, behind, nearest, _, x, y, z] = self.rounded[i];
        let between = self.before[i].is_some() && self.before.get(i + 1) == Some(&Some(i));
        (between && before > 0.0).then(|| {
            let found = Corner { before, behind, nearest, along: [x, y, z] };
            Rounding { found, now: found, aside: found.aside(&self.moves(i)) }
        })
    }

    /// The moves from a target back to the one before and on to the one behind, as found.
    fn moves(&self, i: usize) -> [Three; 2] {
        [less(&self.places[i - 1], &self.places[i]), less(&self.places[i + 1], &self.places[i])]
    }

    /// Return the needs of a target as its neighbours lie now.
    fn need(&self, i: usize) -> Need {
        let mut need = STILL;
        if !self.corrected[i] {
            need.all = 0.0;
        } else if let Some(Rounding { now, aside, .. }) = &self.corners[i] {
            let (v, w) = now.shares(now.nearest);
            let [back, on] = self.moves(i);
            let ends = [sum(&back, &self.moved[i - 1]), sum(&on, &self.moved[i + 1])];
            let besides = less(aside, &now.aside(&ends));
            need.part = (v + w) / (1.0 - v - w);
            need.besides = besides.map(|by| by / (1.0 - v - w));
            need.along = now.along;
        }
        need
    }

    /// What a target moves by as it needs to, where that is something.
    fn needed(&self, i: usize) -> Three {
        let by = self.need(i).of(&self.shift[i]);
        if length(&less(&by, &self.shift[i])) < NOTHING {
            self.shift[i]
        } else {
            by
        }
    }

    /// Let the path pass a target elsewhere by something.
    pub fn pass(&mut self, i: usize, by: Three) {
        self.shift[i] = by;
        self.moved[i] = self.needed(i);
        if let Some(before) = self.before[i] {
            self.moved[before] = self.needed(before);
            self.round(before);
        }
        self.round(i);
    }

    /// Let a target, and the one before it, move as they did elsewhere.
    pub fn follow(&mut self, i: usize, by: Three, moved: Three, before: Three) {
        (self.shift[i], self.moved[i]) = (by, moved);
        if let Some(k) = self.before[i] {
            self.moved[k] = before;
            self.round(k);
        }
        self.round(i);
    }

    /// Round a corner again, as its targets lie now.
    fn round(&mut self, i: usize) {
        if let Some(mut own) = self.corners[i] {
            let (old, at) = (self.moves(i), &self.moved[i]);
            let ends = [&self.moved[i - 1], &self.moved[i + 1]];
            let new = [0, 1].map(|k| less(&sum(&old[k], ends[k]), at));
            own.now = own.found.round(&old, &new);
            self.corners[i] = Some(own);
        }
    }

    /// Return True if no target has moved that the path to a visit depends on.
    pub fn is_quiet(&self, i: usize) -> bool {
        let near = &self.moved[i.saturating_sub(2)..(i + 2).min(self.moved.len())];
        near.iter().flatten().all(|by| *by == 0.0)
    }
}

/// The way to a visit, from the only one that leads there, as far as it does not depend on
/// where the visit is passed.
pub struct Way {
    half: Six,
    /// The target, and how its angles answer.
    here: Six,
    answer: Answer,
    need: Need,
    corner: Option<Corner>,
    /// Angles at the target behind, and what the visit is passed beside its corner by.
    behind: Six,
    beside: Six,
    /// The target that the way leads from, by what it yields as this one moves, and what
    /// stands before it.
    from: Six,
    yields: f64,
    across: Three,
    answer_there: Answer,
    leaves: Option<(Corner, Six)>,
}

impl Way {
    /// Take it from targets that have moved, or that rest where they were found.
    pub fn to(
        i: usize,
        bends: &Bends<'_>,
        answer: &impl Fn(usize) -> Answer,
        rests: bool,
    ) -> Option<Way> {
        let source = bends.before[i]?;
        let target = |k: usize| {
            let moved = if rests { &STAYS } else { &bends.moved[k] };
            if *moved == STAYS {
                bends.targets[k]
            } else {
                sum(&bends.targets[k], &answered(&answer(k), moved))
            }
        };
        let corner = |k: usize| bends.corners[k].map(|own| if rests { own.found } else { own.now });
        let found = bends.corners[i].map(|own| {
            own.found.at(
                [&bends.targets[source], &bends.targets[i], &bends.targets[i + 1]],
                own.found.nearest,
            )
        });
        let found = found.unwrap_or(bends.targets[i]);
        let own = corner(source).filter(|_| bends.corrected[source]);
        let (yields, across) = own.map_or((0.0, STAYS), |own| {
            let (v, w) = own.shares(own.nearest);
            (-w / (1.0 - v - w), own.along)
        });
        Some(Way {
            half: bends.half,
            here: bends.targets[i],
            answer: answer(i),
            need: if rests { STILL } else { bends.need(i) },
            corner: corner(i),
            behind: corner(i).map_or(bends.targets[i], |_| target(i + 1)),
            beside: std::array::from_fn(|j| bends.passed[i][j] - found[j]),
            from: target(source),
            yields,
            across,
            answer_there: answer(source),
            leaves: corner(source).and_then(|own| Some((own, target(bends.before[source]?)))),
        })
    }

    /// Return the clamp of the way where the visit is passed elsewhere by something, and
    /// angles there; the target has moved by something as the way was taken.
    pub fn at(&self, by: &Three, moved: &Three) -> (Clamp, Six) {
        let need = self.need.of(by);
        let more = across(&less(&need, moved), &self.across).map(|part| self.yields * part);
        let here = sum(&self.here, &answered(&self.answer, &need));
        let from = sum(&self.from, &answered(&self.answer_there, &more));
        let mut clamp = Clamp::IDENTITY;
        let mut pass = |q: &Six| clamp = clamp.then(&Clamp::passing(q, &self.half));
        if let Some((corner, before)) = &self.leaves {
            let three = [before, &from, &here];
            if !corner.is_flat(three) {
                pass(&corner.farthest(three, corner.nearest, 1.0));
                pass(&corner.at(three, 1.0));
            }
        }
        let mut end = here;
        if let Some(corner) = &self.corner {
            let three = [&from, &here, &self.behind];
            pass(&corner.at(three, 0.0));
            if !corner.is_flat(three) {
                pass(&corner.farthest(three, 0.0, corner.nearest));
            }
            end = corner.at(three, corner.nearest);
        }
        end = sum(&end, &self.beside);
        pass(&end);
        (clamp, end)
    }

    /// Return for each joint True if it is the path that was found, both at rest.
    pub fn describes(&self, begin: &Six, found: &Clamp) -> [bool; 6] {
        let begin = Clamp::passing(begin, &self.half);
        let (own, found) = (begin.then(&self.at(&STAYS, &STAYS).0), begin.then(found));
        let same = |a: f64, b: f64| a == b || (a - b).abs() < SAME;
        std::array::from_fn(|j| same(own.lo[j], found.lo[j]) && same(own.hi[j], found.hi[j]))
    }
}

/// Something that is found when it is first asked for.
pub fn once<T: Copy>(cells: &[OnceCell<T>], i: usize, find: impl FnOnce() -> T) -> T {
    *cells[i].get_or_init(find)
}

pub fn sum<const K: usize>(a: &[f64; K], b: &[f64; K]) -> [f64; K] {
    std::array::from_fn(|j| a[j] + b[j])
}

fn less(a: &Three, b: &Three) -> Three {
    std::array::from_fn(|k| a[k] - b[k])
}

fn unit(way: &Three) -> Three {
    let long = length(way);
    way.map(|part| if long > NOTHING { part / long } else { 0.0 })
}

fn length(by: &Three) -> f64 {
    by.iter().map(|part| part * part).sum::<f64>().sqrt()
}
