//! The Denavit-Hartenberg chain: `postproc.robot.arm`.

use numpy::{PyArray2, PyArray3, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::rows::{array, blocks, each, rows, Six, Three};
use crate::trig::sin_cos;

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
    pub fn sin_cos(&self, q: &Six) -> (Six, Six) {
        sin_cos(&std::array::from_fn(|i| self.0[i].angle(q)))
    }

    /// Express a point of the flange frame in the base frame.
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

    /// Place the flange, without Hayati's rotations: rows of a pose (4, 4).
    fn flange(&self, q: &Six) -> [f64; 16] {
        let (mut x, mut y, mut z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let mut p = [0.0; 3];
        let (sin, cos) = self.sin_cos(q);
        for (i, link) in self.0.iter().enumerate() {
            let ((sa, ca), (st, ct)) = (link.alpha, (sin[i], cos[i]));
            for k in 0..3 {
                p[k] += link.d * z[k];
                let across = ct * y[k] - st * x[k];
                x[k] = ct * x[k] + st * y[k];
                (y[k], z[k]) = (ca * across + sa * z[k], ca * z[k] - sa * across);
                p[k] += link.a * x[k];
            }
        }
        let mut pose = [0.0; 16];
        for k in 0..3 {
            pose[4 * k..4 * k + 4].copy_from_slice(&[x[k], y[k], z[k], p[k]]);
        }
        pose[15] = 1.0;
        pose
    }
}

impl Link {
    fn angle(&self, q: &Six) -> f64 {
        let mixed: f64 = self.mix.iter().zip(q).map(|(m, q)| m * q).sum();
        self.offset + self.sense * mixed
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
    let poses = each(py, q.len(), |i| chain.flange(&q[i]))?;
    Ok(blocks(py, q.len(), (4, 4), poses.into_flattened()))
}
