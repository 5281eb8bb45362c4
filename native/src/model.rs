//! A model in the core's terms: errors of states, and how sure they are.
//! `postproc.model.evaluator`.

use std::ops::Range;

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::chain::{Chain, Frame, Parameters};
use crate::lines::rotation_vector;
use crate::rows::{array, dot, flat, in_parts, minus, rows, same_length, Six, Three, SIDE, WORTH};
use crate::terms::{faded, swept, Moves, State, Term, Written};
use crate::trig::sin_cos;
use crate::variance::{base_of, put, Form, Geometry};
use crate::walk::{cross, Base, Walk};

/// What a neuron makes of its inputs.
enum Shape {
    Logistic,
    Tanh,
    /// exp(-|x - weights|^2 / 2), with every input in units of its own.
    Gaussian([f64; 12]),
}

/// A layer of neurons, and what each of them moves.
struct Net {
    lower: Six,
    upper: Six,
    /// Of six angles, then of six sides if there are twelve; neuron by neuron.
    weights: Vec<f64>,
    inputs: usize,
    bias: Vec<f64>,
    shape: Shape,
    /// It turns joints and fades outside its range; else it moves the TCP.
    turns: bool,
    /// Sizes, output by output.
    sizes: Vec<f64>,
}

/// Lower and upper ends, weights, biases, shape and its units, turns, sizes: see `Net`.
type WrittenNet = (Six, Six, Vec<f64>, Vec<f64>, (String, Vec<f64>), bool, Vec<f64>);

impl Net {
    fn new((lower, upper, weights, bias, shape, turns, sizes): WrittenNet) -> PyResult<Net> {
        let shape = match (shape.0.as_str(), <[f64; 12]>::try_from(shape.1)) {
            ("logistic", _) => Shape::Logistic,
            ("tanh", _) => Shape::Tanh,
            ("gaussian", Ok(units)) => Shape::Gaussian(units),
            _ => return Err(PyValueError::new_err("neurons of an unknown shape")),
        };
        let inputs = weights.len().checked_div(bias.len()).unwrap_or(6);
        let outputs = if turns { 6 } else { 3 };
        let sound = (inputs == 6 || inputs == 12) && weights.len() == inputs * bias.len();
        if !sound || bias.is_empty() || sizes.len() != outputs * bias.len() {
            return Err(PyValueError::new_err("a layer of other neurons"));
        }
        Ok(Net { lower, upper, weights, inputs, bias, shape, turns, sizes })
    }

    /// Evaluate the neurons.
    fn layer(&self, s: &State<'_>) -> Vec<f64> {
        let (mut x, mut within) = ([0.0; 12], 1.0);
        let gaussian = matches!(self.shape, Shape::Gaussian(_));
        let (least, most) = if gaussian { (2.0, 1.5) } else { (f64::INFINITY, 1.0) };
        for j in 0..6 {
            let mut span = self.upper[j] - self.lower[j];
            span = if span > 1e-9 { span } else { least };
            x[j] = if span.is_finite() {
                (2.0 * (s.q[j] - self.lower[j]) / span - 1.0).clamp(-most, most)
            } else {
                0.0
            };
            x[6 + j] = s.side[j];
            if self.turns {
                within *= faded(s.q[j], self.lower[j], self.upper[j]);
            }
        }
        let neuron = |(weights, bias): (&[f64], &f64)| {
            let z = weights.iter().zip(&x).map(|(w, x)| w * x).sum::<f64>() + bias;
            within
                * match &self.shape {
                    Shape::Logistic => 1.0 / (1.0 + (-z).exp()),
                    Shape::Tanh => z.tanh(),
                    Shape::Gaussian(units) => {
                        let apart = weights.iter().zip(&x).zip(units);
                        let square = apart.map(|((w, x), unit)| ((x - w) / unit).powi(2));
                        (-0.5 * square.sum::<f64>()).exp()
                    }
                }
        };
        self.weights.chunks_exact(self.inputs).zip(&self.bias).map(neuron).collect()
    }

    /// Sum them for every output: joints, or axes of the base.
    fn outputs(&self, s: &State<'_>) -> impl Iterator<Item = f64> + '_ {
        let layer = self.layer(s);
        self.sizes
            .chunks_exact(self.bias.len())
            .map(move |sizes| sizes.iter().zip(&layer).map(|(w, h)| w * h).sum())
    }
}

/// Errors at places: the error anywhere is the mean of the nearest ones, by distance.
struct Map {
    places: Vec<Three>,
    errors: Vec<Three>,
    count: usize,
    power: f64,
}

/// Places [m], errors [m], how many of them count, power of the distance.
type WrittenMap = (Vec<Three>, Vec<Three>, usize, f64);

const NEAREST_GAP: f64 = 1e-6; // [m] a place at the very spot takes all the weight

impl Map {
    fn new((places, errors, count, power): WrittenMap) -> PyResult<Map> {
        same_length(&[places.len(), errors.len()])?;
        if count == 0 || count > places.len() {
            return Err(PyValueError::new_err("a map of fewer places than count"));
        }
        Ok(Map { places, errors, count, power })
    }

    fn error(&self, tcp: &Three) -> Three {
        let mut gaps: Vec<(f64, usize)> = (self.places.iter().enumerate())
            .map(|(k, place)| (minus(tcp, place), k))
            .map(|(way, k)| (dot(&way, &way), k))
            .collect();
        gaps.select_nth_unstable_by(self.count - 1, |a, b| a.0.total_cmp(&b.0));
        let (mut out, mut total) = ([0.0; 3], 0.0);
        for (square, k) in &gaps[..self.count] {
            let weight = square.sqrt().max(NEAREST_GAP).powf(-self.power);
            add_scaled(&mut out, weight, &self.errors[*k]);
            total += weight;
        }
        out.map(|sum| sum / total)
    }
}

/// What a parameter is multiplied with: terms, or a neuron of a net.
enum Unit {
    Terms(Vec<Term>),
    Neuron { net: usize, at: usize, axis: usize },
}

/// A net, a neuron, and the axis of the base that it moves; -1 for none.
type WrittenUnit = (Vec<Written>, (i64, usize, usize));

impl Unit {
    fn new((terms, (net, at, axis)): &WrittenUnit, given: usize) -> PyResult<Unit> {
        if let Ok(net) = usize::try_from(*net) {
            return Ok(Unit::Neuron { net, at: *at, axis: *axis });
        }
        let terms = terms.iter().map(|term| Term::new(term, given));
        Ok(Unit::Terms(terms.collect::<PyResult<_>>()?))
    }

    fn terms(&self) -> &[Term] {
        match self {
            Unit::Terms(terms) => terms,
            Unit::Neuron { .. } => &[],
        }
    }
}

/// How sure a model is of its parameters.
struct Spread {
    form: Form,
    geometry: Geometry,
    /// Parameters that turn no joint alone, then those of the joints.
    free: Vec<Unit>,
    joints: Vec<Unit>,
    nets: Vec<Net>,
}

/// The nominal arm, the arm as a model has it, and the terms of the error.
#[pyclass(frozen)]
pub struct Core {
    nominal: Chain,
    real: Chain,
    base: Base,
    /// Shift of the TCP in the flange frame [m].
    tool: Three,
    terms: Vec<Term>,
    /// The variance of each where it is a spline that has ended [rad^2].
    ended: Vec<f64>,
    nets: Vec<Net>,
    maps: Vec<Map>,
    given: usize,
    weighs: bool,
    spread: Option<Spread>,
    /// What adds to the covariance: of a pose, and of an arrival, standard deviations of
    /// joints [rad] and along axes [m]; and what a method does not know [m].
    pose: (Six, f64),
    arrival: (Six, f64),
    unknown: Three,
}

const AT_ORIGIN: Base = Base {
    axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    about: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    point: [0.0; 3],
};

/// A covariance: xx, yy, zz, then xy, xz, yz.
type Products = [f64; 6];

fn add_outer(sum: &mut Products, v: &Three) {
    for (at, (i, j)) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].into_iter().enumerate() {
        sum[at] += v[i] * v[j];
    }
}

fn add_scaled(sum: &mut Three, factor: f64, v: &Three) {
    for k in 0..3 {
        sum[k] += factor * v[k];
    }
}

/// The columns of states: joint angles and sides, tools, loads, covariates.
#[derive(FromPyObject)]
pub struct States<'py> {
    q: PyReadonlyArray2<'py, f64>,
    side: PyReadonlyArray2<'py, f64>,
    tool: PyReadonlyArray2<'py, f64>,
    load: PyReadonlyArray2<'py, f64>,
    given: PyReadonlyArray2<'py, f64>,
}

/// The same as rows; one tool, or one load, is that of all.
pub struct Rows<'a> {
    pub q: &'a [Six],
    pub side: &'a [Six],
    tool: &'a [Three],
    load: &'a [[f64; 4]],
    given: &'a [f64],
    width: usize,
}

impl<'py> States<'py> {
    pub fn rows(&self, core: &Core) -> PyResult<Rows<'_>> {
        let (q, side) = (rows::<6>(&self.q)?, rows::<6>(&self.side)?);
        let (tool, load) = (rows::<3>(&self.tool)?, rows::<4>(&self.load)?);
        let n = same_length(&[q.len(), side.len()])?;
        let given = flat(&self.given)?;
        let fits = |count: usize| count == 1 || count == n;
        if !fits(tool.len()) || !fits(load.len()) || given.len() != n * core.given {
            return Err(PyValueError::new_err("states of other lengths"));
        }
        Ok(Rows { q, side, tool, load, given, width: core.given })
    }
}

impl Rows<'_> {
    pub fn len(&self) -> usize {
        self.q.len()
    }

    pub fn tool(&self, i: usize) -> &Three {
        if self.tool.len() == 1 {
            &self.tool[0]
        } else {
            &self.tool[i]
        }
    }

    pub fn load(&self, i: usize) -> &[f64; 4] {
        if self.load.len() == 1 {
            &self.load[0]
        } else {
            &self.load[i]
        }
    }

    pub fn given(&self, i: usize) -> &[f64] {
        &self.given[i * self.width..(i + 1) * self.width]
    }
}

impl Core {
    /// Do something with a state, and the frames of its weights.
    #[inline(always)]
    pub fn with_state<T>(
        &self,
        (q, side): (&Six, &Six),
        load: &[f64; 4],
        given: &[f64],
        work: impl FnOnce(&State<'_>) -> T,
    ) -> T {
        let frames: Option<[Frame; 7]> = self.weighs.then(|| self.nominal.frames(q));
        let trig = sin_cos(q);
        work(&State { q, side, load, given, trig: &trig, frames: frames.as_ref() })
    }

    /// What joints are off by [rad].
    fn shift(&self, s: &State<'_>) -> Six {
        let mut out = [0.0; 6];
        for term in &self.terms {
            if let Moves::Joint(j) = term.moves {
                out[j] += term.value(s);
            }
        }
        for net in self.nets.iter().filter(|net| net.turns) {
            for (out, turned) in out.iter_mut().zip(net.outputs(s)) {
                *out += turned;
            }
        }
        out
    }

    fn moves_parts(&self) -> bool {
        let own = |term: &Term| !matches!(term.moves, Moves::Joint(_));
        let nets = self.nets.iter().any(|net| !net.turns);
        nets || !self.maps.is_empty() || self.terms.iter().any(own)
    }

    /// Joint angles and TCP in the flange frame of the real arm.
    fn deviated(&self, s: &State<'_>, tool: &Three) -> (Six, Three) {
        let shift = self.shift(s);
        let q = std::array::from_fn(|j| s.q[j] + shift[j]);
        (q, std::array::from_fn(|k| tool[k] + self.tool[k]))
    }

    /// Actual minus nominal TCP position [m].
    #[inline(always)]
    pub fn error(&self, s: &State<'_>, tool: &Three) -> Three {
        self.error_of(s, tool, &self.deviated(s, tool))
    }

    /// The same where joint angles and TCP of the real arm are known.
    #[inline(always)]
    fn error_of(&self, s: &State<'_>, tool: &Three, (q, point): &(Six, Three)) -> Three {
        let placed = self.real.placed(q, point);
        let [x, y, z] = &self.base.axes;
        let nominal = self.nominal.placed(s.q, tool);
        let mut out: Three = std::array::from_fn(|k| {
            let turned = placed[0] * x[k] + placed[1] * y[k] + placed[2] * z[k];
            turned + self.base.point[k] - nominal[k]
        });
        if self.moves_parts() {
            let walk = Walk::new(&self.nominal, &AT_ORIGIN, s.q, tool);
            for term in &self.terms {
                if !matches!(term.moves, Moves::Joint(_)) {
                    add_scaled(&mut out, term.value(s), &self.motion(&term.moves, &walk, tool));
                }
            }
            for net in self.nets.iter().filter(|net| !net.turns) {
                for (out, moved) in out.iter_mut().zip(net.outputs(s)) {
                    *out += moved;
                }
            }
            for map in &self.maps {
                add_scaled(&mut out, 1.0, &map.error(&walk.tcp));
            }
        }
        out
    }

    /// The motion of the TCP by what a term moves.
    fn motion(&self, moves: &Moves, w: &Walk, tool: &Three) -> Three {
        match moves {
            Moves::Joint(j) => w.jacobian(&self.nominal)[*j],
            Moves::Joints(shares) => {
                let mut out = [0.0; 3];
                for (share, column) in shares.iter().zip(w.jacobian(&self.nominal)) {
                    add_scaled(&mut out, *share, &column);
                }
                out
            }
            Moves::Shift(link, axis) => axis_of(w, *link, *axis),
            Moves::Turn(link, axis) => {
                let mut point = w.tcp;
                if *link == 7 {
                    for (axis, place) in w.flange.iter().zip(tool) {
                        add_scaled(&mut point, -place, axis);
                    }
                } else {
                    point = w.pivot[link - 1];
                }
                swept(&w.tcp, &axis_of(w, *link, *axis), &point)
            }
        }
    }

    /// The turn of the tool by what a term moves.
    fn turning(&self, moves: &Moves, w: &Walk) -> Three {
        let angular = || self.nominal.to_controller(&w.turn);
        match moves {
            Moves::Joint(j) => angular()[*j],
            Moves::Joints(shares) => {
                let mut out = [0.0; 3];
                for (share, column) in shares.iter().zip(angular()) {
                    add_scaled(&mut out, *share, &column);
                }
                out
            }
            Moves::Turn(link, axis) => axis_of(w, *link, *axis),
            Moves::Shift(..) => [0.0; 3],
        }
    }

    /// The tool's rotation from nominal to actual [rad].
    pub fn turn(&self, s: &State<'_>, tool: &Three) -> Three {
        let (q, point) = self.deviated(s, tool);
        let real = Walk::new(&self.real, &self.base, &q, &point);
        let nominal = Walk::new(&self.nominal, &AT_ORIGIN, s.q, tool);
        let mut out = rotation_vector(&std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..3).map(|k| real.flange[k][i] * nominal.flange[k][j]).sum())
        }));
        for term in &self.terms {
            if !matches!(term.moves, Moves::Joint(_)) {
                add_scaled(&mut out, term.value(s), &self.turning(&term.moves, &nominal));
            }
        }
        out
    }
}

/// The kinematics of the real arm in a state.
struct At<'a> {
    walk: &'a Walk,
    jacobian: [Three; 6],
    tool: &'a Three,
}

/// An axis of the frame before a link, base frame; of the flange for the tool.
fn axis_of(w: &Walk, link: usize, axis: usize) -> Three {
    if link == 7 {
        return w.flange[axis];
    }
    if link == 1 {
        return AT_ORIGIN.axes[axis];
    }
    let (x, z) = (w.link[link - 2], w.turn[link - 1]);
    match axis {
        0 => x,
        1 => cross(&z, &x),
        _ => z,
    }
}

impl Core {
    /// The covariance of what sides are not known.
    fn add_sides(&self, sum: &mut Products, s: &State<'_>, at: &At<'_>) {
        let unknown = s.side.map(|side| 1.0 - side.clamp(-1.0, 1.0).powi(2));
        if !unknown.iter().any(|u| *u > 0.0) {
            return;
        }
        let (ahead, behind) = ([1.0; 6], [-1.0; 6]);
        let [there, back] = [&ahead, &behind].map(|side| State { side, ..*s });
        let (forward, backward) = (self.shift(&there), self.shift(&back));
        let mut slopes: [Three; 6] =
            std::array::from_fn(|j| at.jacobian[j].map(|x| x * (forward[j] - backward[j]) / 2.0));
        for term in &self.terms {
            let (Some(j), false) = (term.side(), matches!(term.moves, Moves::Joint(_))) else {
                continue;
            };
            let half = (term.value(&there) - term.value(&back)) / 2.0;
            add_scaled(&mut slopes[j], half, &self.motion(&term.moves, at.walk, at.tool));
        }
        for (slope, unknown) in slopes.iter().zip(unknown) {
            add_outer(sum, &slope.map(|x| x * unknown.max(0.0).sqrt()));
        }
    }

    /// The covariance of scattering joints and places.
    fn add_scatter(sum: &mut Products, jacobian: &[Three; 6], (joints, along): &(Six, f64)) {
        for (column, std) in jacobian.iter().zip(joints) {
            add_outer(sum, &column.map(|x| x * std));
        }
        for own in &mut sum[..3] {
            *own += along * along;
        }
    }

    /// What is unsure of an error but for the parameters, and the scatter of an arrival.
    fn unsure(&self, s: &State<'_>, at: &At<'_>) -> [Products; 2] {
        let (jacobian, mut known, mut scatter) = (&at.jacobian, [0.0; 6], [0.0; 6]);
        self.add_sides(&mut known, s, at);
        for (term, variance) in self.terms.iter().zip(&self.ended) {
            if let Some((j, share)) = term.ended(s).filter(|_| *variance > 0.0) {
                for k in 0..3 {
                    known[k] += jacobian[j][k] * jacobian[j][k] * share * variance;
                }
            }
        }
        for (known, unknown) in known.iter_mut().zip(self.unknown) {
            *known += unknown * unknown;
        }
        Core::add_scatter(&mut known, jacobian, &self.pose);
        Core::add_scatter(&mut scatter, jacobian, &self.arrival);
        [known, scatter]
    }

    /// Error, covariance of the error and of one arrival, of some states.
    fn predict_rows(&self, s: &Rows<'_>, some: Range<usize>) -> Vec<(Three, Products, Products)> {
        let mut out = Vec::with_capacity(some.len());
        let mut block = self.spread.as_ref().map(|spread| spread.form.block());
        for first in some.clone().step_by(SIDE) {
            let own = first..some.end.min(first + SIDE);
            for i in own.clone() {
                let tool = s.tool(i);
                self.with_state((&s.q[i], &s.side[i]), s.load(i), s.given(i), |state| {
                    let real = self.deviated(state, tool);
                    let walk = Walk::new(&self.real, &self.base, &real.0, &real.1);
                    let jacobian = walk.jacobian(&self.nominal);
                    let at = At { walk: &walk, jacobian, tool };
                    let [known, scatter] = self.unsure(state, &at);
                    out.push((self.error_of(state, tool, &real), known, scatter));
                    if let (Some(spread), Some(block)) = (&self.spread, &mut block) {
                        spread.fill(self, block, i - first, state, &at);
                    }
                });
            }
            if let (Some(spread), Some(block)) = (&self.spread, &block) {
                let value = spread.form.value(block);
                let last = out.len() - own.len();
                for (lane, (_, known, _)) in out[last..].iter_mut().enumerate() {
                    for (known, component) in known.iter_mut().zip(&value) {
                        *known += component[lane];
                    }
                }
            }
        }
        for (_, known, scatter) in &mut out {
            for (scatter, known) in scatter.iter_mut().zip(known) {
                *scatter += *known;
            }
        }
        out
    }
}

impl Spread {
    /// Put the columns of a state into a block.
    fn fill(
        &self,
        core: &Core,
        block: &mut crate::variance::Block,
        lane: usize,
        s: &State<'_>,
        at: &At<'_>,
    ) {
        let layers: Vec<Vec<f64>> = self.nets.iter().map(|net| net.layer(s)).collect();
        let (placing, moving) = block.fixed.split_at_mut(self.geometry.len());
        put(placing, lane, self.geometry.columns(at.walk, &core.base));
        let column = |unit: &Unit| match unit {
            Unit::Neuron { net, at, axis } => AT_ORIGIN.axes[*axis].map(|x| x * layers[*net][*at]),
            Unit::Terms(terms) => {
                let mut out = [0.0; 3];
                for term in terms {
                    let moved = core.motion(&term.moves, at.walk, at.tool);
                    add_scaled(&mut out, term.value(s), &moved);
                }
                out
            }
        };
        put(moving, lane, self.free.iter().map(column));
        put(&mut block.jacobian, lane, at.jacobian.into_iter());
        for (phi, unit) in block.basis.iter_mut().zip(&self.joints) {
            phi[lane] = match unit {
                Unit::Neuron { net, at, .. } => layers[*net][*at],
                Unit::Terms(terms) => terms.iter().map(|term| term.value(s)).sum(),
            };
        }
    }
}

/// Standard deviations of joints [rad], and along axes [m].
type Scatter = (Six, f64);
type Block<'py> = Bound<'py, PyArray2<f64>>;
/// The geometry (whether it has the base, its links, whether it has the tool), units that
/// turn no joint alone, those of the joints with the number of each, nets, and the
/// covariance of all.
type WrittenSpread<'py> = (
    (bool, Vec<(usize, usize)>, bool),
    Vec<WrittenUnit>,
    (Vec<WrittenUnit>, [usize; 6]),
    Vec<WrittenNet>,
    PyReadonlyArray1<'py, f64>,
);

fn spread_of(written: WrittenSpread<'_>, given: usize) -> PyResult<Spread> {
    let ((base, links, tool), free, (joints, count), nets, covariance) = written;
    let geometry = Geometry { base, links, tool };
    let units = |all: Vec<WrittenUnit>| -> PyResult<Vec<Unit>> {
        all.iter().map(|unit| Unit::new(unit, given)).collect()
    };
    let (free, joints) = (units(free)?, units(joints)?);
    let nets = nets.into_iter().map(Net::new).collect::<PyResult<Vec<_>>>()?;
    let sound = |unit: &Unit| match unit {
        Unit::Neuron { net, at, axis } => {
            *axis < 3 && nets.get(*net).is_some_and(|net| *at < net.bias.len())
        }
        Unit::Terms(_) => true,
    };
    let odd = geometry.links.iter().any(|(j, kind)| *j >= 6 || *kind >= 5);
    if odd || !free.iter().chain(&joints).all(sound) || joints.len() != count.iter().sum::<usize>()
    {
        return Err(PyValueError::new_err("a covariance of other parameters"));
    }
    let form = Form::new(flat(&covariance)?, geometry.len() + free.len(), count)?;
    Ok(Spread { form, geometry, free, joints, nets })
}

impl Core {
    /// Compute a vector of every state and its tool, (n, 3).
    fn of_states<'py>(
        &self,
        py: Python<'py>,
        states: &States<'py>,
        compute: impl Fn(&State<'_>, &Three) -> Three + Sync,
    ) -> PyResult<Block<'py>> {
        let s = states.rows(self)?;
        let one = |i: usize| {
            self.with_state((&s.q[i], &s.side[i]), s.load(i), s.given(i), |state| {
                compute(state, s.tool(i))
            })
        };
        Ok(array(py, in_parts(py, s.len(), WORTH, |some| some.map(one).collect())?))
    }
}

#[pymethods]
impl Core {
    /// Put a model together.
    ///
    /// Chains: nominal and real. Base: its axes, those of its rotations, its point,
    /// (7, 3). Tool: shift of the TCP in the flange frame [m]. Terms: with their variances
    /// where they have ended. Fields: nets, and maps. Given: how many covariates
    /// states have. Scatter: of a pose that was not measured, of one arrival.
    #[new]
    #[allow(clippy::too_many_arguments, clippy::type_complexity)]
    fn new(
        chains: (Parameters<'_>, Parameters<'_>),
        base: PyReadonlyArray2<'_, f64>,
        tool: Three,
        given: usize,
        terms: (Vec<Written>, Vec<f64>),
        fields: (Vec<WrittenNet>, Vec<WrittenMap>),
        spread: Option<WrittenSpread<'_>>,
        scatter: (Scatter, Scatter, Three),
    ) -> PyResult<Core> {
        let spread = spread.map(|written| spread_of(written, given)).transpose()?;
        let (terms, ended) = terms;
        same_length(&[terms.len(), ended.len()])?;
        let terms: Vec<Term> =
            terms.iter().map(|term| Term::new(term, given)).collect::<PyResult<_>>()?;
        let units = spread.iter().flat_map(|s| s.free.iter().chain(&s.joints));
        let weighs = terms.iter().chain(units.flat_map(|unit| unit.terms())).any(Term::weighs);
        Ok(Core {
            nominal: Chain::new(&chains.0)?,
            real: Chain::new(&chains.1)?,
            base: base_of(rows::<3>(&base)?)?,
            tool,
            terms,
            ended,
            nets: fields.0.into_iter().map(Net::new).collect::<PyResult<_>>()?,
            maps: fields.1.into_iter().map(Map::new).collect::<PyResult<_>>()?,
            given,
            weighs,
            spread,
            pose: scatter.0,
            arrival: scatter.1,
            unknown: scatter.2,
        })
    }

    /// Predict errors, (n, 3) [m].
    fn errors<'py>(&self, py: Python<'py>, states: States<'py>) -> PyResult<Block<'py>> {
        self.of_states(py, &states, |state, tool| self.error(state, tool))
    }

    /// Predict the tool's rotations from nominal to actual, (n, 3) [rad].
    fn turns<'py>(&self, py: Python<'py>, states: States<'py>) -> PyResult<Block<'py>> {
        self.of_states(py, &states, |state, tool| self.turn(state, tool))
    }

    /// Predict errors (n, 3) [m], and covariances of errors and of one arrival each,
    /// (n, 6) [m^2]: xx, yy, zz, then xy, xz, yz.
    #[allow(clippy::type_complexity)]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        states: States<'py>,
    ) -> PyResult<(Block<'py>, Block<'py>, Block<'py>)> {
        let s = states.rows(self)?;
        let found = in_parts(py, s.len(), WORTH, |some| self.predict_rows(&s, some))?;
        let mut parts = (Vec::new(), Vec::new(), Vec::new());
        for (error, known, arrival) in found {
            parts.0.push(error);
            parts.1.push(known);
            parts.2.push(arrival);
        }
        Ok((array(py, parts.0), array(py, parts.1), array(py, parts.2)))
    }
}
