//! The Denavit-Hartenberg chain: `postproc.robot.arm`.

use numpy::{PyArray2, PyArray3, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::rows::{array, blocks, each, minus, rows, same_length, Lanes, Six, Three, SIDE};
use crate::trig::sin_cos;
use crate::walk::cross;

pub struct Link {
    pub a: f64,
    pub d: f64,
    offset: f64,
    pub sense: f64,
    pub alpha: (f64, f64),
    /// Hayati's rotation, where there is one.
    pub beta: Option<(f64, f64)>,
    pub mix: Six,
}

/// Links from the base to the flange; angles in pairs of sine and cosine.
pub struct Chain(pub [Link; 6]);

/// Rows a [m], d [m], alpha [rad], offset [rad], sense, beta [rad], then the columns of
/// the mix of joint angles, (12, 6).
pub type Parameters<'py> = PyReadonlyArray2<'py, f64>;

impl Chain {
    pub fn new(parameters: &Parameters<'_>) -> PyResult<Chain> {
        let p = rows::<6>(parameters)?;
        if p.len() != 12 {
            return Err(PyValueError::new_err("a chain has 12 rows of parameters"));
        }
        Ok(Chain(std::array::from_fn(|i| Link {
            a: p[0][i],
            d: p[1][i],
            alpha: p[2][i].sin_cos(),
            offset: p[3][i],
            sense: p[4][i],
            beta: (p[5][i] != 0.0).then(|| p[5][i].sin_cos()),
            mix: std::array::from_fn(|j| p[6 + j][i]),
        })))
    }

    /// Return sines and cosines of the D-H angles.
    #[inline(always)]
    pub fn sin_cos(&self, q: &Six) -> (Six, Six) {
        sin_cos(&std::array::from_fn(|i| self.0[i].angle(q)))
    }

    /// Express a point of the flange frame in the base frame.
    #[inline(always)]
    pub fn placed(&self, q: &Six, point: &Three) -> Three {
        let [mut x, mut y, mut z] = *point;
        let (sin, cos) = self.sin_cos(q);
        for (i, link) in self.0.iter().enumerate().rev() {
            if let Some((sb, cb)) = link.beta {
                (x, z) = (cb * x + sb * z, cb * z - sb * x);
            }
            let ((sa, ca), (st, ct)) = (link.alpha, (sin[i], cos[i]));
            x += link.a;
            (y, z) = (ca * y - sa * z, sa * y + ca * z + link.d);
            (x, y) = (ct * x - st * y, st * x + ct * y);
        }
        [x, y, z]
    }

    /// The same for several poses, side by side.
    #[inline(always)]
    pub fn placed_side_by_side(&self, q: &[Lanes; 6], point: &[Lanes; 3]) -> [Lanes; 3] {
        let [mut x, mut y, mut z] = *point;
        for link in self.0.iter().rev() {
            let ((sa, ca), (sin, cos)) = (link.alpha, sin_cos(&link.angles(q)));
            for k in 0..SIDE {
                if let Some((sb, cb)) = link.beta {
                    (x[k], z[k]) = (cb * x[k] + sb * z[k], cb * z[k] - sb * x[k]);
                }
                x[k] += link.a;
                (y[k], z[k]) = (ca * y[k] - sa * z[k], sa * y[k] + ca * z[k] + link.d);
                (x[k], y[k]) = (cos[k] * x[k] - sin[k] * y[k], sin[k] * x[k] + cos[k] * y[k]);
            }
        }
        [x, y, z]
    }

    /// Walk along the D-H frames 0 (base) to 6 (flange), without Hayati's rotations.
    #[inline(always)]
    pub fn frames(&self, q: &Six) -> [Frame; 7] {
        let mut at =
            Frame { axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], origin: [0.0; 3] };
        let (sin, cos) = self.sin_cos(q);
        let mut out = [at; 7];
        for (i, link) in self.0.iter().enumerate() {
            let ((sa, ca), (st, ct)) = (link.alpha, (sin[i], cos[i]));
            let ([x, y, z], p) = (&mut at.axes, &mut at.origin);
            for k in 0..3 {
                p[k] += link.d * z[k];
                let across = ct * y[k] - st * x[k];
                x[k] = ct * x[k] + st * y[k];
                (y[k], z[k]) = (ca * across + sa * z[k], ca * z[k] - sa * across);
                p[k] += link.a * x[k];
            }
            out[i + 1] = at;
        }
        out
    }

    /// Convert what belongs to the D-H angles to what belongs to the controller's.
    #[inline(always)]
    pub fn to_controller<const K: usize>(&self, per_axis: &[[f64; K]; 6]) -> [[f64; K]; 6] {
        let mut out = [[0.0; K]; 6];
        for (link, axis) in self.0.iter().zip(per_axis) {
            for (column, mix) in out.iter_mut().zip(link.mix) {
                for k in 0..K {
                    column[k] += mix * link.sense * axis[k];
                }
            }
        }
        out
    }
}

/// Axes x, y, z and the origin [m].
#[derive(Clone, Copy)]
pub struct Frame {
    pub axes: [Three; 3],
    pub origin: Three,
}

impl Frame {
    /// Rows of a pose (4, 4).
    #[inline(always)]
    fn pose(&self) -> [f64; 16] {
        let mut pose = [0.0; 16];
        for k in 0..3 {
            let [x, y, z] = self.axes;
            pose[4 * k..4 * k + 4].copy_from_slice(&[x[k], y[k], z[k], self.origin[k]]);
        }
        pose[15] = 1.0;
        pose
    }

    /// Express a point of this frame in the base frame.
    #[inline(always)]
    pub fn place(&self, point: &Three) -> Three {
        let [x, y, z] = &self.axes;
        let turned = |k: usize| x[k] * point[0] + y[k] * point[1] + z[k] * point[2];
        std::array::from_fn(|k| self.origin[k] + turned(k))
    }
}

impl Link {
    pub fn angle(&self, q: &Six) -> f64 {
        let mixed: f64 = self.mix.iter().zip(q).map(|(m, q)| m * q).sum();
        self.offset + self.sense * mixed
    }

    #[inline(always)]
    fn angles(&self, q: &[Lanes; 6]) -> Lanes {
        let mut mixed = [0.0; SIDE];
        for (m, q) in self.mix.iter().zip(q) {
            for k in 0..SIDE {
                mixed[k] += m * q[k];
            }
        }
        mixed.map(|mixed| self.offset + self.sense * mixed)
    }
}

/// Place points of the flange frame, (n, 3) or (1, 3) for all, (n, 3) [m].
#[pyfunction]
pub fn placed<'py>(
    py: Python<'py>,
    parameters: Parameters<'py>,
    q: PyReadonlyArray2<'py, f64>,
    point: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (chain, q, point) = (Chain::new(&parameters)?, rows::<6>(&q)?, rows::<3>(&point)?);
    if point.len() != 1 && point.len() != q.len() {
        return Err(PyValueError::new_err("as many points as poses, or one"));
    }
    let of = |i: usize| if point.len() == 1 { &point[0] } else { &point[i] };
    Ok(array(py, each(py, q.len(), |i| chain.placed(&q[i], of(i)))?))
}

/// Place the flange, (n, 4, 4) [m].
#[pyfunction]
pub fn flange<'py>(
    py: Python<'py>,
    parameters: Parameters<'py>,
    q: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (chain, q) = (Chain::new(&parameters)?, rows::<6>(&q)?);
    let poses = each(py, q.len(), |i| chain.frames(&q[i])[6].pose())?;
    Ok(blocks(py, q.len(), (4, 4), poses.into_flattened()))
}

/// Place the frames 0 (base) to 6 (flange), (n, 7, 16) [m].
#[pyfunction]
pub fn frames<'py>(
    py: Python<'py>,
    parameters: Parameters<'py>,
    q: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (chain, q) = (Chain::new(&parameters)?, rows::<6>(&q)?);
    let poses = each(py, q.len(), |i| chain.frames(&q[i]).map(|f| f.pose()))?;
    Ok(blocks(py, q.len(), (7, 16), poses.into_flattened().into_flattened()))
}

/// Place the origins of frames 2 and 4, and points of the flange frame, (n, 3, 3) [m].
#[pyfunction]
pub fn landmarks<'py>(
    py: Python<'py>,
    parameters: Parameters<'py>,
    q: PyReadonlyArray2<'py, f64>,
    point: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (chain, q, point) = (Chain::new(&parameters)?, rows::<6>(&q)?, rows::<3>(&point)?);
    same_length(&[q.len(), point.len()])?;
    let places = each(py, q.len(), |i| {
        let frames = chain.frames(&q[i]);
        [frames[2].origin, frames[4].origin, frames[6].place(&point[i])]
    })?;
    Ok(blocks(py, q.len(), (3, 3), places.into_flattened().into_flattened()))
}

/// Differentiate points of the flange frame by the controller's joint angles, (n, 6, 6):
/// joint by joint the velocity of the point [m/rad] and the angular velocity.
#[pyfunction]
pub fn jacobian<'py>(
    py: Python<'py>,
    parameters: Parameters<'py>,
    q: PyReadonlyArray2<'py, f64>,
    point: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (chain, q, point) = (Chain::new(&parameters)?, rows::<6>(&q)?, rows::<3>(&point)?);
    same_length(&[q.len(), point.len()])?;
    let columns = each(py, q.len(), |i| {
        let frames = chain.frames(&q[i]);
        let place = frames[6].place(&point[i]);
        chain.to_controller(&std::array::from_fn(|j| {
            let axis = &frames[j].axes[2];
            let [x, y, z] = cross(axis, &minus(&place, &frames[j].origin));
            [x, y, z, axis[0], axis[1], axis[2]]
        }))
    })?;
    Ok(blocks(py, q.len(), (6, 6), columns.into_flattened().into_flattened()))
}

/// Torque about every joint of the links' weights, and of what the flange carries, (n, 6)
/// each: for a unit of acceleration along the base's z.
///
/// Arguments:
///     links: Mass [kg] and centre in its D-H frame [m] of every link, (6, 4).
///     load: The same of what the flange carries, (n, 4), or (1, 4) for all.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn torque<'py>(
    py: Python<'py>,
    parameters: Parameters<'py>,
    q: PyReadonlyArray2<'py, f64>,
    links: PyReadonlyArray2<'py, f64>,
    load: PyReadonlyArray2<'py, f64>,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
    let (chain, q) = (Chain::new(&parameters)?, rows::<6>(&q)?);
    let (links, load) = (rows::<4>(&links)?, rows::<4>(&load)?);
    same_length(&[links.len(), 6])?;
    if load.len() != 1 {
        same_length(&[q.len(), load.len()])?;
    }
    let of = |i: usize| if load.len() == 1 { &load[0] } else { &load[i] };
    let both = each(py, q.len(), |i| chain.torque(&q[i], links, of(i)))?;
    let (own, carried) = both.into_iter().unzip();
    Ok((array(py, own), array(py, carried)))
}

/// Weights that a joint carries.
#[derive(Default)]
struct Weights {
    mass: f64,
    moment: Three,
}

impl Weights {
    fn add(&mut self, [mass, x, y, z]: [f64; 4], frame: &Frame) {
        if mass == 0.0 {
            return; // its centre need not be known
        }
        self.mass += mass;
        for (moment, centre) in self.moment.iter_mut().zip(frame.place(&[x, y, z])) {
            *moment += mass * centre;
        }
    }

    /// Torque about an axis z of a frame.
    fn about(&self, frame: &Frame) -> [f64; 1] {
        let (axis, p) = (&frame.axes[2], &frame.origin);
        let lever = |k: usize| self.moment[k] - self.mass * p[k];
        [axis[0] * lever(1) - axis[1] * lever(0)]
    }
}

impl Chain {
    /// From the flange back to the base, every joint carries what came before.
    fn torque(&self, q: &Six, links: &[[f64; 4]], load: &[f64; 4]) -> (Six, Six) {
        let frames = self.frames(q);
        let (mut own, mut carried) = (Weights::default(), Weights::default());
        carried.add(*load, &frames[6]);
        let mut per_axis = [[[0.0]; 6]; 2];
        for j in (0..6).rev() {
            own.add(links[j], &frames[j + 1]);
            (per_axis[0][j], per_axis[1][j]) = (own.about(&frames[j]), carried.about(&frames[j]));
        }
        let [own, carried] = per_axis.map(|axes| self.to_controller(&axes).map(|[t]| t));
        (own, carried)
    }
}
