//! Terms of a predicted error: what moves, by which law of which driver.
//! `postproc.model.terms`.

use std::f64::consts::{PI, TAU};

use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::chain::Frame;
use crate::rows::{array, dot, in_parts, minus, rows, same_length, Six, Three, WORTH};
use crate::trig::sin_cos;
use crate::walk::cross;

/// A name, and the numbers that belong to it.
pub type Named = (String, Vec<f64>);
/// What moves, the law, what drives it, and what it is multiplied with.
pub type Written = (Named, Named, Vec<Named>, Vec<Named>);

/// One state, and what drivers need of it.
pub struct State<'a> {
    pub q: &'a Six,
    pub side: &'a Six,
    /// Mass [kg] and its centre in the flange frame [m].
    pub load: &'a [f64; 4],
    /// Values of the covariates that do not follow from these.
    pub given: &'a [f64],
    /// Sines and cosines of the joint angles.
    pub trig: &'a (Six, Six),
    /// Nominal frames 0 to 6, where weight drives something.
    pub frames: Option<&'a [Frame; 7]>,
}

fn refused(what: &str, name: &str) -> PyErr {
    PyValueError::new_err(format!("there is no {what} {name:?} of such numbers"))
}

/// Weight: moments about the axes of the frames, of links and of what is carried.
struct Weight {
    pull: Three,
    /// Shares of the moments about the axes of frame k, of all behind it.
    share: [Three; 6],
    /// Mass [kg] and first moment [kg m] of every link, in its frame.
    links: [[f64; 4]; 6],
    /// Share of the load, and places [m] by which it counts elsewhere, in every link's
    /// frame.
    carried: f64,
    places: [Three; 6],
}

impl Weight {
    fn new(n: &[f64]) -> Option<Weight> {
        if n.len() != 64 {
            return None;
        }
        let three = |at: usize| [n[at], n[at + 1], n[at + 2]];
        Some(Weight {
            pull: three(0),
            share: std::array::from_fn(|k| three(3 + 3 * k)),
            links: std::array::from_fn(|k| std::array::from_fn(|i| n[21 + 4 * k + i])),
            carried: n[45],
            places: std::array::from_fn(|k| three(46 + 3 * k)),
        })
    }

    /// Add up the shares, from the flange back to the base.
    fn value(&self, frames: &[Frame; 7], load: &[f64; 4]) -> f64 {
        let heavy = load[0] != 0.0;
        let (mut mass, mut first, mut total) = (0.0, [0.0; 3], 0.0);
        let mut add = |own: f64, moment: &Three, frame: &Frame| {
            if own == 0.0 && *moment == [0.0; 3] {
                return (mass, first);
            }
            let [x, y, z] = &frame.axes;
            for k in 0..3 {
                let turned = x[k] * moment[0] + y[k] * moment[1] + z[k] * moment[2];
                first[k] += turned + own * frame.origin[k];
            }
            mass += own;
            (mass, first)
        };
        if heavy && self.carried != 0.0 {
            let centre = [load[1], load[2], load[3]].map(|c| load[0] * self.carried * c);
            add(load[0] * self.carried, &centre, &frames[6]);
        }
        for k in (0..6).rev() {
            let [own, x, y, z] = self.links[k];
            let place = if heavy { self.places[k].map(|p| load[0] * p) } else { [0.0; 3] };
            let moment = [x + place[0], y + place[1], z + place[2]];
            let (mass, first) = add(own, &moment, &frames[k + 1]);
            if self.share[k] != [0.0; 3] {
                let lever: Three = std::array::from_fn(|i| first[i] - mass * frames[k].origin[i]);
                let about = cross(&lever, &self.pull);
                for (share, axis) in self.share[k].iter().zip(&frames[k].axes) {
                    total += share * dot(axis, &about);
                }
            }
        }
        total
    }
}

/// What drives a term.
enum Driver {
    Angle(usize),
    /// Of a drive that several joints turn.
    Drive(Six),
    Side(usize),
    Given(usize),
    Weight(Box<Weight>),
    /// The size of three of them.
    Size(Box<[Weight; 3]>),
}

impl Driver {
    fn new((name, n): &Named) -> PyResult<Driver> {
        let index = || n.first().map(|at| *at as usize);
        let joint = || index().filter(|j| *j < 6);
        let found = match name.as_str() {
            "angle" => joint().map(Driver::Angle),
            "drive" => n.as_slice().try_into().ok().map(Driver::Drive),
            "side" => joint().map(Driver::Side),
            "given" => index().map(Driver::Given),
            "weight" => Weight::new(n).map(|w| Driver::Weight(Box::new(w))),
            "size" if n.len() == 192 => {
                let parts: Vec<_> = n.chunks(64).filter_map(Weight::new).collect();
                parts.try_into().ok().map(|three| Driver::Size(Box::new(three)))
            }
            _ => None,
        };
        found.ok_or_else(|| refused("driver", name))
    }

    fn value(&self, s: &State<'_>) -> f64 {
        match self {
            Driver::Angle(j) => s.q[*j],
            Driver::Drive(row) => row.iter().zip(s.q).map(|(r, q)| r * q).sum(),
            Driver::Side(j) => s.side[*j],
            Driver::Given(at) => s.given[*at],
            Driver::Weight(w) => s.frames.map_or(f64::NAN, |f| w.value(f, s.load)),
            Driver::Size(three) => s.frames.map_or(f64::NAN, |f| {
                three.iter().map(|w| w.value(f, s.load).powi(2)).sum::<f64>().sqrt()
            }),
        }
    }

    fn weighs(&self) -> bool {
        matches!(self, Driver::Weight(_) | Driver::Size(_))
    }

    fn is_sound(&self, given: usize) -> bool {
        !matches!(self, Driver::Given(at) if *at >= given)
    }
}

/// Fall from 1 inside a range to 0 a tenth outside: `effect.fade`.
pub fn faded(x: f64, low: f64, high: f64) -> f64 {
    if x.is_nan() {
        return x;
    }
    let out = (low - x).max(x - high).max(0.0) / (0.1 * (high - low)).max(1e-9);
    let t = out.clamp(0.0, 1.0);
    ((1.0 - t * t * (3.0 - 2.0 * t)) * 1e12).round_ties_even() / 1e12
}

/// The same of what repeats with every turn: `effect.fade_turns`.
fn faded_turns(x: f64, low: f64, high: f64) -> f64 {
    if (low..=high).contains(&x) || high - low > 0.95 * TAU {
        return 1.0;
    }
    let middle = (low + high) / 2.0;
    faded(nearest_turn(x, middle), low, high)
}

/// The angle on the turn round a middle.
fn nearest_turn(x: f64, middle: f64) -> f64 {
    middle + (x - middle + PI).rem_euclid(TAU) - PI
}

/// Sines and cosines of whole multiples of an angle, each times a size.
struct Waves {
    low: f64,
    high: f64,
    mean: f64,
    sizes: Vec<[f64; 2]>,
}

impl Waves {
    #[inline(always)]
    fn value(&self, x: f64, (sin, cos): (f64, f64)) -> f64 {
        let within = faded_turns(x, self.low, self.high);
        let (mut total, mut s, mut c) = (self.mean, 0.0, 1.0);
        for [of_sin, of_cos] in &self.sizes {
            (s, c) = (s * cos + c * sin, c * cos - s * sin);
            total += of_sin * (s * within) + of_cos * (c * within);
        }
        total
    }
}

/// A cubic spline on an even grid.
struct Spline {
    lower: f64,
    upper: f64,
    /// It has ends, outside of which it fades.
    ends: bool,
    /// The middle of the turn that counts, where it repeats with every turn.
    middle: Option<f64>,
    mix: Vec<f64>,
}

impl Spline {
    /// Take both ends, whether it has ends and repeats, the middle and the mix.
    fn new(n: &[f64]) -> Option<Spline> {
        let mix = n.get(5..)?.to_vec();
        (mix.len() >= 4).then(|| Spline {
            lower: n[0],
            upper: n[1],
            ends: n[2] != 0.0,
            middle: (n[3] != 0.0).then_some(n[4]),
            mix,
        })
    }

    fn place(&self, x: f64) -> f64 {
        self.middle.map_or(x, |middle| nearest_turn(x, middle))
    }

    fn within(&self, x: f64) -> f64 {
        if self.ends {
            faded(x, self.lower, self.upper)
        } else {
            1.0
        }
    }

    /// Knot k of the grid without the points next to its ends.
    fn knot(&self, k: usize) -> f64 {
        let points = self.mix.len();
        if k < 4 {
            0.0
        } else if k >= points {
            1.0
        } else {
            (k - 2) as f64 * (1.0 / (points - 1) as f64)
        }
    }

    /// Sum the four splines that are not 0 there (de Boor: A Practical Guide to Splines).
    fn value(&self, x: f64) -> f64 {
        let x = self.place(x);
        if x.is_nan() {
            return x;
        }
        let along = (x.clamp(self.lower, self.upper) - self.lower) / (self.upper - self.lower);
        let (u, points) = (along.clamp(0.0, 1.0), self.mix.len());
        // Knots 3, 4, .. stand at grid points 0, 2, 3, ..
        let on_grid = (u * (points - 1) as f64) as usize;
        let mut last = (on_grid + 2).clamp(3, points - 1);
        while last < points - 1 && u >= self.knot(last + 1) {
            last += 1;
        }
        while last > 3 && u < self.knot(last) {
            last -= 1;
        }
        let mut d: [f64; 4] = std::array::from_fn(|k| self.mix[last - 3 + k]);
        for r in 1..4 {
            for k in (r..4).rev() {
                let i = last - 3 + k;
                let (a, b) = (self.knot(i), self.knot(i + 4 - r));
                let share = (u - a) / (b - a);
                d[k] = (1.0 - share) * d[k - 1] + share * d[k];
            }
        }
        d[3] * self.within(x)
    }
}

/// Legendre polynomials over the range of one driver.
struct Range {
    low: f64,
    high: f64,
    /// A way: half of the range lies below its median.
    way: bool,
    /// It fades outside of its range.
    fades: bool,
    /// How far outside it goes on as a straight line.
    beyond: f64,
}

const END: f64 = 0.05; // part of a range whose slope goes on outside

impl Range {
    /// Evaluate the polynomials, and by how much they count.
    fn terms(&self, x: f64, degree: usize) -> (Vec<f64>, f64) {
        let within = if self.fades { known(faded(x, self.low, self.high)) } else { 1.0 };
        let x = known(x);
        let u = if self.way {
            x / (x + self.high.max(1e-12))
        } else {
            (x - self.low) / (self.high - self.low).max(1e-12)
        };
        let inside = u.clamp(0.0, 1.0);
        let mut terms = legendre(2.0 * inside - 1.0, degree);
        let out = (u - inside).clamp(-self.beyond, self.beyond);
        if out != 0.0 {
            let (a, b) = if out < 0.0 { (-1.0, 2.0 * END - 1.0) } else { (1.0 - 2.0 * END, 1.0) };
            let (first, last) = (legendre(a, degree), legendre(b, degree));
            for (k, term) in terms.iter_mut().enumerate() {
                *term += (last[k] - first[k]) / END * out;
            }
        }
        (terms, within)
    }
}

fn legendre(x: f64, degree: usize) -> Vec<f64> {
    let mut out = vec![1.0, x];
    for n in 2..=degree {
        let k = n as f64;
        out.push((out[n - 1] * x * (2.0 * k - 1.0) - out[n - 2] * (k - 1.0)) / k);
    }
    out.truncate(degree + 1);
    out
}

/// What is not known counts as 0.
fn known(x: f64) -> f64 {
    if x.is_nan() {
        0.0
    } else {
        x
    }
}

/// Products of Legendre polynomials of one or two drivers.
struct Curve {
    ranges: Vec<Range>,
    /// Degrees in each driver, and the size.
    terms: Vec<([usize; 2], f64)>,
    degree: [usize; 2],
}

impl Curve {
    /// Take how many drivers there are, five numbers of each, then three of every term.
    fn new(n: &[f64]) -> Option<Curve> {
        let count = *n.first()? as usize;
        let (ranges, terms) = n[1..].split_at_checked(5 * count)?;
        let range = |r: &[f64]| Range {
            low: r[0],
            high: r[1],
            way: r[2] != 0.0,
            fades: r[3] != 0.0,
            beyond: r[4],
        };
        let term = |t: &[f64]| ([t[0] as usize, t[1] as usize], t[2]);
        let terms: Vec<_> = terms.chunks_exact(3).map(term).collect();
        let most = |k: usize| terms.iter().map(|(degree, _)| degree[k]).max().unwrap_or(0);
        let degree = [most(0), most(1)];
        (1..=2).contains(&count).then(|| Curve {
            ranges: ranges.chunks_exact(5).map(range).collect(),
            terms,
            degree,
        })
    }

    fn value(&self, x: &[f64]) -> f64 {
        let (first, mut within) = self.ranges[0].terms(x[0], self.degree[0]);
        let mut second = vec![1.0];
        if let (Some(range), Some(y)) = (self.ranges.get(1), x.get(1)) {
            let (terms, also) = range.terms(*y, self.degree[1]);
            (second, within) = (terms, within * also);
        }
        let sum: f64 = self.terms.iter().map(|([i, j], size)| size * first[*i] * second[*j]).sum();
        sum * within
    }
}

/// A function of one driver, or of two.
enum Law {
    Constant(f64),
    Linear { k: f64, middle: f64, half: f64 },
    Step { k: f64, middle: f64, half: f64 },
    Bend { k: f64, slope: f64, middle: f64, half: f64 },
    Size { k: f64, power: f64, unit: f64 },
    Wave { order: f64, sin: f64, cos: f64 },
    Waves(Box<Waves>),
    Friction { k: f64, way: f64 },
    Dahl { k: f64, way: f64 },
    Elastic { k: f64, way: f64 },
    Warming { k: f64, level: f64, start: f64, lasts: f64 },
    Spring { k: f64, ratio: f64, upright: f64, preload: f64 },
    Bumps { width: f64, each: Vec<[f64; 2]> },
    Spline(Box<Spline>),
    Curve(Box<Curve>),
}

impl Law {
    fn new((name, n): &Named) -> PyResult<Law> {
        let found = match (name.as_str(), n.as_slice()) {
            ("constant", &[k]) => Some(Law::Constant(k)),
            ("linear", &[k, middle, half]) => Some(Law::Linear { k, middle, half }),
            ("step", &[k, middle, half]) => Some(Law::Step { k, middle, half }),
            ("bend", &[k, slope, middle, half]) => Some(Law::Bend { k, slope, middle, half }),
            ("size", &[k, power, unit]) => Some(Law::Size { k, power, unit }),
            ("wave", &[order, sin, cos]) => Some(Law::Wave { order, sin, cos }),
            ("waves", [low, high, mean, sizes @ ..]) => Some(Law::Waves(Box::new(Waves {
                low: *low,
                high: *high,
                mean: *mean,
                sizes: sizes.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect(),
            }))),
            ("friction", &[k, way]) => Some(Law::Friction { k, way }),
            ("dahl", &[k, way]) => Some(Law::Dahl { k, way }),
            ("elastic", &[k, way]) => Some(Law::Elastic { k, way }),
            ("warming", &[k, level, start, lasts]) => Some(Law::Warming { k, level, start, lasts }),
            ("spring", &[k, ratio, upright, preload]) => {
                Some(Law::Spring { k, ratio, upright, preload })
            }
            ("bumps", [width, each @ ..]) => Some(Law::Bumps {
                width: *width,
                each: each.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect(),
            }),
            ("spline", n) => Spline::new(n).map(|s| Law::Spline(Box::new(s))),
            ("curve", n) => Curve::new(n).map(|c| Law::Curve(Box::new(c))),
            _ => None,
        };
        found.ok_or_else(|| refused("law", name))
    }

    /// How many drivers it has.
    fn width(&self) -> usize {
        match self {
            Law::Constant(_) => 0,
            Law::Dahl { .. } => 2,
            Law::Curve(curve) => curve.ranges.len(),
            _ => 1,
        }
    }

    fn value(&self, by: &[f64]) -> f64 {
        let x = by.first().copied().unwrap_or(0.0);
        match self {
            Law::Constant(k) => *k,
            Law::Linear { k, middle, half } => (x - middle) / half * k,
            Law::Step { k, middle, half } => {
                if (x - middle) / half < 0.0 {
                    -k
                } else {
                    *k
                }
            }
            Law::Bend { k, slope, middle, half } => {
                let bent = ((x - middle) / half).tanh();
                k * bent + slope * (1.0 - bent * bent)
            }
            Law::Size { k, power, unit } => {
                let size = (x / unit).abs();
                size * (k + power * size.max(1e-6).ln())
            }
            Law::Wave { order, sin, cos } => {
                let (s, c) = (order * x).sin_cos();
                sin * s + cos * c
            }
            Law::Waves(waves) => waves.value(x, x.sin_cos()),
            Law::Friction { k, way } => k * (1.0 - 2.0 * (-x / way).exp()),
            Law::Dahl { k, way } => {
                let share = 1.0 - (-by[1] / way).exp();
                k * (1.0 - 2.0 * share * (-x / way).exp())
            }
            Law::Elastic { k, way } => -k * (PI * (x / way).min(1.0)).cos(),
            Law::Warming { k, level, start, lasts } => {
                k * known(level - (-((x - start).max(0.0 * x)) / lasts).exp())
            }
            Law::Spring { k, ratio, upright, preload } => {
                let torque = |u: f64| {
                    let length = (1.0 + ratio * ratio - 2.0 * ratio * u.cos()).sqrt();
                    (length - (1.0 - ratio) + preload) * ratio * u.sin() / length
                };
                k * torque(x - upright) / torque(PI / 2.0)
            }
            Law::Bumps { width, each } => {
                let bump = |[centre, size]: &[f64; 2]| {
                    let away = (x - centre) / width;
                    size * (-0.5 * away * away).exp()
                };
                each.iter().map(bump).sum()
            }
            Law::Spline(spline) => spline.value(x),
            Law::Curve(curve) => curve.value(by),
        }
    }
}

/// What a term moves.
#[derive(Clone, Copy)]
pub enum Moves {
    /// A joint, through the whole kinematics.
    Joint(usize),
    /// Joints by shares, as far as the TCP follows at the first order.
    Joints(Six),
    /// All behind a link's joint about an axis of the frame before it; 7 is the tool.
    Turn(usize, usize),
    /// The same along it.
    Shift(usize, usize),
}

impl Moves {
    fn new((name, n): &Named) -> PyResult<Moves> {
        let part = || match n.as_slice() {
            [link, axis] if (1.0..=7.0).contains(link) && (0.0..=2.0).contains(axis) => {
                Some((*link as usize, *axis as usize))
            }
            _ => None,
        };
        let found = match name.as_str() {
            "joint" => n.first().map(|j| *j as usize).filter(|j| *j < 6).map(Moves::Joint),
            "joints" => n.as_slice().try_into().ok().map(Moves::Joints),
            "turn" => part().map(|(link, axis)| Moves::Turn(link, axis)),
            "shift" => part().map(|(link, axis)| Moves::Shift(link, axis)),
            _ => None,
        };
        found.ok_or_else(|| refused("motion", name))
    }
}

/// One term: what it moves by is the law times the factors.
pub struct Term {
    pub moves: Moves,
    law: Law,
    by: Vec<Driver>,
    times: Vec<Driver>,
}

impl Term {
    /// Read a term; `given` is how many covariates states have.
    pub fn new((moves, law, by, times): &Written, given: usize) -> PyResult<Term> {
        let drivers = |all: &[Named]| all.iter().map(Driver::new).collect::<PyResult<Vec<_>>>();
        let (name, (by, times)) = (&law.0, (drivers(by)?, drivers(times)?));
        let (law, moves) = (Law::new(law)?, Moves::new(moves)?);
        let sound = by.iter().chain(&times).all(|driver| driver.is_sound(given));
        if by.len() != law.width() || !sound {
            return Err(refused("law", name));
        }
        Ok(Term { moves, law, by, times })
    }

    /// Evaluate it: an angle [rad], or a shift [m].
    pub fn value(&self, s: &State<'_>) -> f64 {
        let law = match (&self.law, self.by.first()) {
            (Law::Waves(waves), Some(Driver::Angle(j))) => {
                waves.value(s.q[*j], (s.trig.0[*j], s.trig.1[*j]))
            }
            _ => {
                let mut by = [0.0; 2];
                for (value, driver) in by.iter_mut().zip(&self.by) {
                    *value = driver.value(s);
                }
                self.law.value(&by[..self.by.len()])
            }
        };
        self.times.iter().fold(law, |value, factor| value * known(factor.value(s)))
    }

    /// Tell whether weight drives it.
    pub fn weighs(&self) -> bool {
        self.by.iter().chain(&self.times).any(Driver::weighs)
    }

    /// The joint whose side of arrival it depends on.
    pub fn side(&self) -> Option<usize> {
        self.by.iter().chain(&self.times).find_map(|driver| match driver {
            Driver::Side(j) => Some(*j),
            _ => None,
        })
    }

    /// How far a spline has ended, 0 to 1, and its joint.
    pub fn ended(&self, s: &State<'_>) -> Option<(usize, f64)> {
        let (Law::Spline(spline), Moves::Joint(joint)) = (&self.law, self.moves) else {
            return None;
        };
        let x = spline.place(self.by[0].value(s));
        Some((joint, 1.0 - spline.within(x).powi(2)))
    }
}

/// Turn joints by terms of their angles and sides, (n, 6) [rad].
#[pyfunction]
pub fn turned<'py>(
    py: Python<'py>,
    terms: Vec<Written>,
    q: PyReadonlyArray2<'py, f64>,
    side: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (q, side) = (rows::<6>(&q)?, rows::<6>(&side)?);
    let n = same_length(&[q.len(), side.len()])?;
    let terms = terms.iter().map(|t| Term::new(t, 0)).collect::<PyResult<Vec<_>>>()?;
    let row = |i: usize| -> Six {
        let trig = sin_cos(&q[i]);
        let (load, frames) = (&[0.0; 4], None);
        let s = State { q: &q[i], side: &side[i], load, given: &[], trig: &trig, frames };
        let mut out = [0.0; 6];
        for term in &terms {
            if let Moves::Joint(j) = term.moves {
                out[j] += term.value(&s);
            }
        }
        out
    };
    Ok(array(py, in_parts(py, n, WORTH, |some| some.map(row).collect())?))
}

/// The motion of the TCP by a turn about an axis through a point.
pub fn swept(tcp: &Three, axis: &Three, point: &Three) -> Three {
    cross(axis, &minus(tcp, point))
}
