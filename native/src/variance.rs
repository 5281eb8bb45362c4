//! What uncertain parameters of geometry and joints give: `postproc.model.evaluator`.
//!
//! The columns of all parameters that turn one joint are its column of the Jacobian, by
//! a number each: their part of the covariance shrinks to one row per joint.

use std::ops::Range;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::rows::{Lanes, Three, SIDE};
use crate::walk::{Base, Walk};

/// Three components of each.
pub type Column = [Lanes; 3];
/// The covariance of three components of each: the diagonal, then xy, xz and yz.
pub type Products = [Lanes; 6];
/// Which components are off the diagonal, in that order.
const OFF: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

pub const NOTHING: Column = [[0.0; SIDE]; 3];

#[inline(always)]
fn add(sum: &mut Lanes, factor: f64, of: &Lanes) {
    for k in 0..SIDE {
        sum[k] += factor * of[k];
    }
}

#[inline(always)]
fn add_product(sum: &mut Lanes, a: &Lanes, b: &Lanes) {
    for k in 0..SIDE {
        sum[k] += a[k] * b[k];
    }
}

/// Add what a column gives, with half the form's sums over it and those before.
#[inline(always)]
fn add_column(total: &mut Products, sums: &Column, column: &Column) {
    for k in 0..3 {
        add_product(&mut total[k], &sums[k], &column[k]);
        let (i, j) = OFF[k];
        for lane in 0..SIDE {
            total[3 + k][lane] +=
                0.5 * (sums[i][lane] * column[j][lane] + sums[j][lane] * column[i][lane]);
        }
    }
}

pub fn put(columns: &mut [Column], lane: usize, values: impl Iterator<Item = Three>) {
    for (column, value) in columns.iter_mut().zip(values) {
        for k in 0..3 {
            column[k][lane] = value[k];
        }
    }
}

/// Parameters of the geometry, in the order of their columns.
pub struct Geometry {
    pub base: bool,
    /// Joint, and which of a, d, alpha, theta, beta.
    pub links: Vec<(usize, usize)>,
    pub tool: bool,
}

impl Geometry {
    pub fn len(&self) -> usize {
        6 * usize::from(self.base) + self.links.len() + 3 * usize::from(self.tool)
    }

    /// Derivatives of the TCP, as in `geometry.Geometry.columns`.
    pub fn columns(&self, w: &Walk, base: &Base) -> impl Iterator<Item = Three> {
        let mut out = Vec::with_capacity(self.len());
        if self.base {
            out.extend([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
            out.extend(base.about.iter().map(|axis| w.swept(axis, &base.point)));
        }
        out.extend(self.links.iter().map(|&(j, kind)| match kind {
            0 => w.link[j],
            1 => w.turn[j],
            2 => w.swept(&w.link[j], &w.corner[j]),
            3 => w.swept(&w.turn[j], &w.pivot[j]),
            _ => w.swept(&w.bend[j], &w.corner[j]),
        }));
        if self.tool {
            out.extend(w.flange);
        }
        out.into_iter()
    }
}

/// What the form is taken of.
pub struct Block {
    pub fixed: Vec<Column>,
    pub jacobian: [Column; 6],
    pub basis: Vec<Lanes>,
}

/// A quadratic form of columns of the geometry, then of joints.
pub struct Form {
    /// Lower half of the covariance, with what is off the diagonal twice.
    lower: Vec<f64>,
    size: usize,
    /// How many columns are the geometry's.
    fixed: usize,
    /// Those of each joint, counted from there.
    joints: [Range<usize>; 6],
}

impl Form {
    /// Take a covariance (p, p) of the geometry's parameters, then of the joints'.
    pub fn new(covariance: &[f64], fixed: usize, count: [usize; 6]) -> PyResult<Form> {
        let size = fixed + count.iter().sum::<usize>();
        if covariance.len() != size * size {
            return Err(PyValueError::new_err("a covariance of other parameters"));
        }
        let mut end = 0;
        let joints = count.map(|n| {
            end += n;
            end - n..end
        });
        let doubled = |(at, c): (usize, &f64)| if at / size == at % size { *c } else { 2.0 * c };
        let lower = covariance.iter().enumerate().map(doubled).collect();
        Ok(Form { lower, size, fixed, joints })
    }

    /// Make room for the columns of some states.
    pub fn block(&self) -> Block {
        Block {
            fixed: vec![NOTHING; self.fixed],
            jacobian: [NOTHING; 6],
            basis: vec![[0.0; SIDE]; self.size - self.fixed],
        }
    }

    #[inline(always)]
    fn row(&self, k: usize) -> &[f64] {
        &self.lower[k * self.size..(k + 1) * self.size]
    }

    /// Evaluate it with the widest registers of this machine; the numbers are the same.
    pub fn value(&self, block: &Block) -> Products {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: this machine has what the function is compiled for.
            return unsafe { self.value_wide(block) };
        }
        self.value_of(block)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    unsafe fn value_wide(&self, block: &Block) -> Products {
        self.value_of(block)
    }

    #[inline(always)]
    fn value_of(&self, block: &Block) -> Products {
        let mut total = [[0.0; SIDE]; 6];
        for (u, column) in block.fixed.iter().enumerate() {
            let mut sums = NOTHING;
            for (k, sum) in sums.iter_mut().enumerate() {
                for (c, before) in self.row(u).iter().zip(&block.fixed[..=u]) {
                    add(sum, *c, &before[k]);
                }
            }
            add_column(&mut total, &sums, column);
        }
        let mut with = vec![[0.0; SIDE]; self.fixed];
        for (a, own) in self.joints.iter().enumerate() {
            let mut among = [[0.0; SIDE]; 6];
            with.fill([0.0; SIDE]);
            for k in own.clone() {
                let (of_fixed, of_joints) = self.row(self.fixed + k).split_at(self.fixed);
                let phi = &block.basis[k];
                for (with, c) in with.iter_mut().zip(of_fixed) {
                    add(with, *c, phi);
                }
                for (b, others) in self.joints[..=a].iter().enumerate() {
                    let mut inner = [0.0; SIDE];
                    let lower = others.start..others.end.min(k + 1);
                    for (c, phi) in of_joints[lower.clone()].iter().zip(&block.basis[lower]) {
                        add(&mut inner, *c, phi);
                    }
                    add_product(&mut among[b], &inner, phi);
                }
            }
            let mut sums = NOTHING;
            for (k, sum) in sums.iter_mut().enumerate() {
                for (with, column) in with.iter().zip(&block.fixed) {
                    add_product(sum, with, &column[k]);
                }
                for (with, column) in among[..=a].iter().zip(&block.jacobian) {
                    add_product(sum, with, &column[k]);
                }
            }
            add_column(&mut total, &sums, &block.jacobian[a]);
        }
        total
    }
}

pub fn base_of(rows: &[Three]) -> PyResult<Base> {
    match rows {
        [x, y, z, a, b, c, point] => {
            Ok(Base { axes: [*x, *y, *z], about: [*a, *b, *c], point: *point })
        }
        _ => Err(PyValueError::new_err("a base has 7 rows")),
    }
}
